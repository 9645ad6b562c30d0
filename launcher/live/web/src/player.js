// The bar of a recorded flight: play, pause, time and speed. The server has the position, which all browsers share.

export function player() {
  const form = document.getElementById('player');
  const { play, position, speed, at } = form.elements;
  const refused = document.getElementById('refused');
  let span = [0, 1];
  let playing = false;
  let sought = null; // newest time that the user has chosen and that was not sent to the server
  let asking = false;

  async function order(body) {
    try {
      const response = await fetch('/command', {
        method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(body),
      });
      const answer = response.ok ? await response.json() : { ok: false, said: await response.text() };
      refused.textContent = answer.ok ? '' : answer.said;
    } catch (error) {
      refused.textContent = `the page’s server does not answer (${error.message})`;
    }
  }

  // Sends one order at a time while the user drags: after each answer, the newest time that was chosen meanwhile.
  async function seek() {
    if (asking) return;
    asking = true;
    while (sought !== null) {
      const time_s = sought;
      sought = null;
      await order({ command: 'seek', time_s });
    }
    asking = false;
  }

  function tell(time) {
    at.textContent = `${time.toFixed(1)} of ${span[1].toFixed(1)} s`;
    position.setAttribute('aria-valuetext', `${time.toFixed(1)} seconds of ${span[1].toFixed(1)}`);
  }

  form.addEventListener('submit', event => {
    event.preventDefault();
    order({ command: playing ? 'pause' : 'play' });
  });
  position.addEventListener('input', () => {
    sought = Math.min(Math.max(Number(position.value), span[0]), span[1]);
    tell(sought);
    seek();
  });
  speed.addEventListener('change', () => order({ command: 'speed', speed: Number(speed.value) }));

  return {
    begin({ begin_s, end_s }) {
      span = [begin_s, end_s];
      [position.min, position.max] = span;
    },
    show(frame) {
      playing = frame.playing;
      play.textContent = playing ? 'Pause' : 'Play';
      if (document.activeElement !== speed) speed.value = frame.speed;
      if (asking) return; // the user is ahead of the server
      position.value = frame.position_s;
      tell(frame.position_s);
    },
    enable(on) {
      for (const control of [play, position, speed]) control.disabled = !on;
    },
  };
}
