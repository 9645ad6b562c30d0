//! Maps: a coloured cell with its text for every pair of entries of two axes.

use std::fmt::Write;

use super::axes::{Axis, LETTER};
use super::{Svg, escape};

/// Width and height of a cell \[px\].
const CELL: (f64, f64) = (44.0, 34.0);
/// Largest number of letters of a label below a cell that is not turned.
const ACROSS: usize = 6;

/// Cividis at equal steps, which colour-blind readers see as others do: red, green, blue.
const CIVIDIS: [[f64; 3]; 9] = [
    [0.0, 34.0, 78.0],
    [18.0, 53.0, 112.0],
    [59.0, 73.0, 108.0],
    [87.0, 93.0, 109.0],
    [112.0, 113.0, 115.0],
    [138.0, 134.0, 120.0],
    [165.0, 156.0, 116.0],
    [195.0, 179.0, 105.0],
    [254.0, 232.0, 56.0],
];

/// A cell of a map.
#[derive(Debug, Clone)]
pub struct MapCell {
    /// Position on the scale of colours, 0 to 1.
    pub shade: f64,
    pub label: String,
    /// Text below the label.
    pub note: String,
    pub title: String,
}

/// Draws a map of `cells` over two axes, row by row from below; a cell may be absent. A thick line separates two
/// neighbours, each given as row and column, for which `border` is true.
pub fn map(
    title: &str,
    [across, up]: [&Axis; 2],
    cells: &[Vec<Option<MapCell>>],
    border: impl Fn([usize; 2], [usize; 2]) -> bool,
) -> String {
    let (columns, rows) = (across.entries.len(), up.entries.len());
    let left = (up.longest() as f64 * LETTER + 12.0).max(40.0);
    let turned = across.longest() > ACROSS;
    let words_px = if turned { across.longest() as f64 * LETTER * 0.7 + 14.0 } else { 18.0 };
    let title_px = if title.is_empty() { 4.0 } else { 22.0 };
    let top = title_px + if up.title.is_empty() { 0.0 } else { 18.0 };
    let (w, h) = (CELL.0 * columns as f64, CELL.1 * rows as f64);
    let (bottom, below) = (top + h, words_px + if across.title.is_empty() { 2.0 } else { 20.0 });
    let (x, y) = (|column: f64| left + CELL.0 * column, |row: f64| bottom - CELL.1 * row);
    let headings = [title, &up.title, &across.title].map(|text| text.chars().count() as f64 * LETTER * 1.25);
    let width = (left + w + if turned { 26.0 } else { 18.0 }).max(headings[0]).max(headings[1]).max(headings[2]);
    let mut svg = Svg::sized(width, bottom + below, &escape(&format!("{title}: {} over {}", up.title, across.title)));
    svg.text(4.0, 14.0, "map", &escape(title));
    svg.text(4.0, top - 8.0, "tick", &escape(&up.title));
    svg.text((left + w / 2.0).max(headings[2] / 2.0), bottom + below - 4.0, "tick middle", &escape(&across.title));
    for (place, word) in &across.ticks {
        let (x, word) = (x(*place), escape(word));
        if turned {
            let (x, y) = (x + 4.0, bottom + 13.0);
            svg.add(format_args!(
                "<text class=\"tick end\" transform=\"translate({x:.1} {y:.1}) rotate(-45)\">{word}</text>"
            ));
        } else {
            svg.text(x, bottom + 14.0, "tick middle", &word);
        }
    }
    for (place, word) in &up.ticks {
        svg.text(left - 6.0, y(*place) + 4.0, "tick end", &escape(word));
    }
    let mut line = String::new();
    for (row, of_row) in cells.iter().enumerate() {
        for (column, cell) in of_row.iter().enumerate() {
            let Some(cell) = cell else { continue };
            let (x, y) = (x(column as f64), y(row as f64 + 1.0));
            cell.draw(&mut svg, [x, y]);
            let differs = |other: [usize; 2]| {
                let is_there = cells.get(other[0]).and_then(|row| row.get(other[1])).is_some_and(Option::is_some);
                is_there && border([row, column], other)
            };
            if differs([row, column + 1]) {
                let _ = write!(line, "M{:.1} {y:.1}v{}", x + CELL.0, CELL.1); // writing to a String cannot fail
            }
            if differs([row + 1, column]) {
                let _ = write!(line, "M{x:.1} {y:.1}h{}", CELL.0);
            }
        }
    }
    if !line.is_empty() {
        svg.add(format_args!("<path class=\"border\" d=\"{line}\"/>"));
    }
    svg.finish()
}

impl MapCell {
    fn draw(&self, svg: &mut Svg, [x, y]: [f64; 2]) {
        let class = if self.shade > 0.55 { "dark" } else { "light" };
        let (w, h) = CELL;
        svg.add(format_args!(
            "<g class=\"{class}\"><title>{}</title>\
             <rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w}\" height=\"{h}\" style=\"fill:{}\"/>",
            escape(&self.title),
            colour(self.shade.clamp(0.0, 1.0))
        ));
        let label_px = if self.note.is_empty() { h / 2.0 + 4.0 } else { 15.0 };
        svg.text(x + w / 2.0, y + label_px, "value middle", &escape(&self.label));
        svg.text(x + w / 2.0, y + 28.0, "value note middle", &escape(&self.note));
        svg.add("</g>");
    }
}

/// Returns the colour of a place on the scale, 0 to 1.
fn colour(shade: f64) -> String {
    let position = shade * (CIVIDIS.len() - 1) as f64;
    let lower = (position as usize).min(CIVIDIS.len() - 2);
    let [r, g, b] = std::array::from_fn(|i| {
        let (from, to) = (CIVIDIS[lower][i], CIVIDIS[lower + 1][i]);
        (from + (position - lower as f64) * (to - from)).round()
    });
    format!("rgb({r},{g},{b})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_border_runs_between_the_neighbours_that_differ() {
        let cell = || Some(MapCell { shade: 1.0, label: "<1>".into(), note: "n 2".into(), title: String::new() });
        let cells = [vec![cell(), cell()], vec![cell(), None]];
        let axis = Axis::of_values("x", vec!["a".into(), "b".into()]);
        let svg = map("", [&axis, &axis], &cells, |one, other| one[0] == other[0]);
        assert!(svg.contains("class=\"border\" d=\"M84.0 56.0v34\""), "one step to the right, none to no cell: {svg}");
        assert_eq!(svg.matches("<rect").count(), 3, "no flights, no cell");
        assert!(svg.contains("&lt;1&gt;") && !map("", [&axis, &axis], &cells, |_, _| false).contains("border"));
    }
}
