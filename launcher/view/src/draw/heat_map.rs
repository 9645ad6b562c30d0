//! Heat maps: values over two axes of evenly spaced entries.
//!
//! Colour is the logarithm of the value, in cividis, which colour-blind readers see as others do; the number stands in
//! every cell, and a cell without a value is hatched.

use super::Svg;

/// Width and height of a cell \[px\].
const CELL: (f64, f64) = (46.0, 27.0);
/// Room for labels to the left of the cells, above and below \[px\].
const ROOM: (f64, f64, f64) = (68.0, 22.0, 38.0);
/// Cividis at equal steps: red, green, blue.
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

/// The colours of several maps.
pub struct HeatMap {
    /// Values at the ends of the scale.
    pub scale: (f64, f64),
    /// Quantity of the values.
    pub values: &'static str,
    /// Quantities of the columns and of the rows.
    pub axes: [&'static str; 2],
}

/// One cell.
pub struct HeatCell {
    pub column: f64,
    pub row: f64,
    /// Value that sets the colour; `None` is hatched.
    pub value: Option<f64>,
    pub label: String,
    pub title: String,
}

impl HeatMap {
    /// Draws the map of `cells`. Entries of the axes ascend. `point` is a row value and two column values: a dot is
    /// drawn at the first and a line from there to the second, below the numbers of the nearest row.
    pub fn draw(
        &self,
        title: &str,
        [columns, rows]: [&[f64]; 2],
        cells: &[HeatCell],
        point: Option<[f64; 3]>,
    ) -> String {
        let (left, top, below) = ROOM;
        let (w, h) = (CELL.0 * columns.len() as f64, CELL.1 * rows.len() as f64);
        let x = |position: f64| left + CELL.0 * position;
        let y = |position: f64| top + h - CELL.1 * position;
        let [across, up] = self.axes;
        let across = &if is_even(columns) { across.to_owned() } else { format!("{across}, in uneven steps") };
        let mut svg =
            Svg::sized(left + w + 4.0, top + h + below, &format!("{} over {across} and {up}, {title}", self.values));
        svg.text(left, 14.0, "map", title);
        for (i, entry) in columns.iter().enumerate() {
            svg.text(x(i as f64 + 0.5), top + h + 14.0, "tick middle", &entry.to_string());
        }
        svg.text(left + w / 2.0, top + h + 32.0, "tick middle", across);
        for (i, entry) in rows.iter().enumerate() {
            svg.text(left - 6.0, y(i as f64 + 0.5) + 4.0, "tick end", &entry.to_string());
        }
        svg.text(left - 6.0, 14.0, "tick end", up);
        for cell in cells {
            self.cell(&mut svg, cell, x(position(columns, cell.column)), y(position(rows, cell.row) + 1.0));
        }
        if let Some([row, from, to]) = point {
            let at = |value: f64| x(position(columns, value) + 0.5);
            // At the lower edge of the nearest row, where it covers no number.
            let (from, to, cy) = (at(from), at(to), y(position(rows, row).round()) - 4.5);
            for class in ["halo", "point"] {
                svg.add(format_args!(
                    "<g class=\"{class}\"><circle cx=\"{from:.1}\" cy=\"{cy:.1}\" r=\"4\"/>\
                     <path d=\"M{from:.1} {cy:.1}H{to:.1}m0 -4v8\"/></g>"
                ));
            }
        }
        svg.finish()
    }

    /// Draws the scale of colours with these `ticks`, and the meaning of the hatching.
    pub fn legend(&self, ticks: &[f64], unit: &str, hatched: &str) -> String {
        const STEPS: usize = 60;
        let (left, width) = (24.0, 300.0);
        let (low, high) = self.scale;
        let mut svg = Svg::sized(460.0, 44.0, &format!("scale of colours, {low} to {high} {unit}; hatched: {hatched}"));
        for i in 0..STEPS {
            let (x, fill) = (left + width * i as f64 / STEPS as f64, colour(i as f64 / (STEPS - 1) as f64));
            let step = width / STEPS as f64 + 0.5;
            svg.add(format_args!(
                "<rect x=\"{x:.1}\" y=\"4\" width=\"{step:.1}\" height=\"16\" style=\"fill:{fill}\"/>"
            ));
        }
        for value in ticks {
            svg.text(left + width * self.shade(*value), 36.0, "tick middle", &format!("{value} {unit}"));
        }
        svg.add("<g class=\"lost\"><rect x=\"364\" y=\"4\" width=\"46\" height=\"16\"/></g>");
        svg.text(418.0, 17.0, "tick", hatched);
        // The hatching is defined here once, for every map of the page.
        svg.add(
            "<defs><pattern id=\"hatch\" width=\"7\" height=\"7\" patternUnits=\"userSpaceOnUse\" \
             patternTransform=\"rotate(45)\"><rect class=\"hatch-ground\" width=\"7\" height=\"7\"/>\
             <path class=\"hatch-line\" d=\"M0 0V7\"/></pattern></defs>",
        );
        svg.finish()
    }

    fn cell(&self, svg: &mut Svg, cell: &HeatCell, x: f64, y: f64) {
        let (w, h) = CELL;
        let (class, style) = match cell.value.map(|value| self.shade(value)) {
            Some(shade) => (if shade > 0.55 { "dark" } else { "light" }, format!("fill:{}", colour(shade))),
            None => ("lost", String::new()),
        };
        svg.add(format_args!(
            "<g class=\"{class}\"><title>{}</title>\
             <rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w}\" height=\"{h}\" style=\"{style}\"/>",
            cell.title
        ));
        svg.text(x + w / 2.0, y + h / 2.0 + 4.0, "value middle", &cell.label);
        svg.add("</g>");
    }

    /// Returns the place of a value on the scale of colours, 0 to 1.
    fn shade(&self, value: f64) -> f64 {
        let (low, high) = self.scale;
        ((value / low).ln() / (high / low).ln()).clamp(0.0, 1.0)
    }
}

/// Returns whether the entries of an axis are as far apart as they are drawn.
fn is_even(axis: &[f64]) -> bool {
    let steps: Vec<f64> = axis.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.iter().all(|step| (step - steps[0]).abs() < 1e-9 * steps[0].abs())
}

/// Returns the place of `value` on an axis of evenly spaced entries, in entries from the first; no farther than the
/// ends.
fn position(axis: &[f64], value: f64) -> f64 {
    let after = axis.partition_point(|entry| *entry < value);
    match (after, axis.get(after)) {
        (0, _) => 0.0,
        (_, None) => axis.len() as f64 - 1.0,
        (_, Some(next)) => after as f64 - (next - value) / (next - axis[after - 1]),
    }
}

/// The colour of a place on the scale, 0 to 1.
pub(super) fn colour(shade: f64) -> String {
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
    fn the_point_covers_no_number_and_uneven_steps_are_told() {
        let map = HeatMap { scale: (0.1, 1.0), values: "error", axes: ["delay [ms]", "jitter [ms]"] };
        let (columns, rows) = ([0.0, 4.0, 10.0], [0.0, 5.0]);
        let cell = |row: f64| HeatCell { column: 4.0, row, value: Some(0.5), label: "x".into(), title: String::new() };
        let drawn = |row: f64| map.draw("t", [&columns, &rows], &rows.map(cell), Some([row, 2.0, 7.0]));
        for row in [0.0, 1.3, 5.0] {
            let svg = drawn(row);
            let numbers = |begin: &str| -> Vec<f64> {
                let after = svg.split(begin).skip(1);
                after.filter_map(|rest| rest.split('"').next()?.parse().ok()).collect()
            };
            let cells: Vec<f64> = svg
                .match_indices("value middle")
                .map(|(at, _)| {
                    let text = &svg[svg[..at].rfind("<text").expect("a text")..];
                    text.split(" y=\"")
                        .nth(1)
                        .and_then(|rest| rest.split('"').next()?.parse().ok())
                        .expect("its height")
                })
                .collect();
            assert_eq!(cells.len(), 2, "{svg}");
            for cy in numbers("cy=\"") {
                assert!(cells.iter().all(|base| cy - 4.0 > *base || cy + 4.0 < base - 9.0), "{row}: {cy} {cells:?}");
            }
        }
        assert!(drawn(0.0).contains("delay [ms], in uneven steps"));
        assert!(is_even(&[0.0, 5.0, 10.0]) && is_even(&[0.0]) && is_even(&[]));
    }
}
