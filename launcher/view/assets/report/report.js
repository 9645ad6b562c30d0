// Returns the figures of the report and of the live page: [element, plots] of each figure that the page has a place
// for.

function flightFigures(realtime) {
  'use strict';
  const DEG = 180 / Math.PI;
  const series = (label, column, colour, more) => ({ label, column, colour, ...more });
  const reference = column => series('reference', column, 'ink', { dash: [5, 4], width: 1 });
  const command = (label, column, colour) => series(label, column, colour, { dash: [2, 3], width: 1 });
  // `scale` turns the column into `unit`; `suffix` is the unit after numbers, where it is another; `span` is the least
  // range worth showing; `floor` starts the range at zero; `lines` names the lines that the plot is compared with.
  // `words` names the values of a quantity that has few. Series whose columns the flight lacks are left out.
  const measured = (column, colour = 'pink') => series('measured', `${column}_measured`, colour, { width: 1 });
  const angle = name => ({ unit: 'deg', scale: DEG, span: 1, series: [measured(name), series(GREEK[name], name, 'blue'), reference(`${name}_ref`)] });
  const rate = name => ({ unit: 'rad/s', span: 0.05, series: [measured(name), series(name, name, 'blue'), reference(`${name}_ref`)] });
  const position = (name, column, scale) => ({ unit: 'm', scale, span: 0.5, series: [measured(column), series(name, column, 'blue'),
    series('mission', `${column}_wanted`, 'ink', { dash: [5, 4], width: 1 })] });
  const acceleration = side => ({ unit: 'm/s²', span: 0.1, series: [series('estimate of guidance', `estimate_${side}`, 'orange', { width: 1 }),
    series(`${side}, not explained by the tilt`, `unexplained_${side}`, 'blue', { dash: [9, 4] })] });
  // The estimate's error between three of its standard deviations.
  const off = (unit, name, label, scale) => ({ unit, scale, span: 0.01, digits: 4, series: [series(label, `off_${name}`, 'blue'),
    ...[1, -1].map(sign => series(sign > 0 ? '3 σ' : '−3 σ', `expected_${name}`, 'ink', { dash: [5, 4], width: 1, factor: sign }))] });
  const error = axis => ({ unit: 'm', span: 0.02, lines: `error_${axis}`, series: [series(`${axis} error`, `error_${axis}`, 'blue')] });
  const GREEK = { phi: 'φ', theta: 'θ', psi: 'ψ' };

  const RUNGS = ['demand', 'held', 'levelled', 'descending', 'trim only', 'cut', 'ended'];

  const FIGURES = {
    fig5: [position('altitude', 'z', -1), position('north', 'x'), position('east', 'y')],
    fig6: [{ unit: 'm', span: 0.02, floor: true, lines: 'error', series: [series('position error', 'error', 'blue')] }],
    fig7: ['x', 'y', 'z'].map(error),
    fig8: ['phi', 'theta', 'psi'].map(angle),
    fig9: [...['p', 'q', 'r'].map(rate), {
      unit: 'm/s', span: 0.2, series: [series('u', 'u', 'blue'), series('v', 'v', 'orange', { dash: [9, 4] }), series('w', 'w', 'green', { dash: [2, 3] })],
    }],
    fig10: [{ unit: 'm/s', span: 0.2, series: [measured('w'), series('w', 'w', 'blue'), reference('w_ref')] }],
    fig11: [{
      unit: 'rotor speed unit', suffix: '', span: 50, lines: 'rotors', digits: 1,
      series: [series('Ω₁', 'omega1', 'blue'), series('Ω₂', 'omega2', 'orange'), series('Ω₃', 'omega3', 'green'),
        ...[['Ω₁ command', 'omega1_command', 'blue'], ['Ω₂ command', 'omega2_command', 'orange'],
          ['Ω₃ command', 'omega3_command', 'green']].map(c => ({ ...command(...c), show: false }))],
    }],
    fig12: [{ unit: 'deg', scale: DEG, span: 2, lines: 'tilt', series: [series('μ', 'tilt', 'blue'), command('command', 'tilt_command', 'orange')] }],
    inputs: [
      { unit: 'N', span: 0.5, series: [series('col', 'col', 'blue')] },
      { unit: 'N m', span: 0.02, series: [series('lon', 'lon', 'blue'), series('lat', 'lat', 'orange', { dash: [9, 4] }), series('ped', 'ped', 'green', { dash: [2, 3] })] },
    ],
    effort: [{ unit: 'u′Ru', span: 0.1, floor: true, series: [series('control effort', 'effort', 'blue')] }],
    rung: [{ unit: '', words: RUNGS, series: [series('mixer flies by', 'rung', 'blue')] }],
    wind: [
      { unit: 'm/s', span: 0.5, series: [series('wind north', 'wind_north', 'blue'), series('east', 'wind_east', 'orange', { dash: [9, 4] }),
        series('down', 'wind_down', 'green', { dash: [2, 3] })] },
      acceleration('ahead'), acceleration('right'),
    ],
    estimate: [
      ...['north', 'east', 'down'].map(axis => off('m', axis, axis)),
      ...['north', 'east', 'down'].map(axis => off('m/s', `${axis}_speed`, `velocity ${axis}`)),
      ...['roll', 'pitch', 'yaw'].map(axis => off('deg', axis, `turn about the ${axis} axis`, DEG)),
    ],
    innovations: [
      { unit: 'share of gate', span: 0.5, floor: true, lines: 'gate', suffix: '', series: [['position', 'blue'], ['velocity', 'orange'],
        ['height', 'green'], ['heading', 'pink'], ['flow', 'ink']].map(([name, colour]) => series(name, `innovation_${name}`, colour, { width: 1 })) },
      { unit: 'so far', span: 5, floor: true, suffix: '', digits: 0, series: [series('refused', 'refused', 'blue'), series('resets', 'resets', 'orange', { dash: [9, 4] })] },
    ],
    age: [
      { unit: 'ms', span: 0.5, floor: true, series: [series('age', 'age_ms', 'blue')] },
      { unit: 'm', span: 0.02, floor: true, lines: 'error', series: [series('position error', 'error', 'orange')] },
    ],
  };

  if (!realtime) FIGURES.age = [];
  const figures = Object.keys(FIGURES).map(id => [document.querySelector(`#${id} .plots`), FIGURES[id]]);
  return figures.filter(([element]) => element);
}

if (document.getElementById('flight')) {
  const flight = JSON.parse(document.getElementById('flight').textContent);
  const paths = ['space', 'plan'].map(view => document.querySelector(`.${view}`));
  timePlots({ flights: [flight], happened: flight.happened, lines: flight.lines }, flightFigures(flight.realtime), paths);
}
