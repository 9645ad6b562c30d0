// Replaces the shown page by each new version. The window keeps its scroll position and its focus, and unfolded parts
// stay unfolded.
(() => {
  'use strict';
  const RECONNECT_MS = 1000;
  let fetching = false;
  let stale = false; // a version came while one was fetched

  async function refresh() {
    stale = true;
    if (fetching) return;
    fetching = true;
    while (stale) {
      stale = false;
      try {
        const response = await fetch(location.href);
        if (response.ok) show(new DOMParser().parseFromString(await response.text(), 'text/html'));
      } catch { /* the server has ended; the socket reports that */ }
    }
    fetching = false;
  }

  function show(version) {
    const main = document.querySelector('main');
    const [left, top] = [scrollX, scrollY];
    const open = [...main.querySelectorAll('details')].map(details => details.open);
    const focused = document.activeElement?.id;
    document.title = version.title;
    main.replaceChildren(...version.querySelector('main').childNodes);
    main.querySelectorAll('details').forEach((details, i) => { details.open = open[i] ?? details.open; });
    if (focused) document.getElementById(focused)?.focus({ preventScroll: true });
    scrollTo(left, top);
  }

  function connect() {
    const socket = new WebSocket(`ws${location.protocol.slice(4)}//${location.host}/ws`);
    let ended = false;
    socket.onmessage = ({ data }) => {
      ended = JSON.parse(data).phase === 'ended';
      refresh();
    };
    socket.onclose = () => {
      if (!ended) setTimeout(connect, RECONNECT_MS);
    };
  }

  connect();
})();
