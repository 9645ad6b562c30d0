//! Time plots of flights, for every page: flights laid over each other on one time axis, with their happenings as
//! bands, lines and lanes, and with their paths. The scripts of `assets/report/` draw them.

use base64::prelude::{BASE64_STANDARD, Engine};
use outcome::happenings::Happenings;
use serde::Serialize;
use serde_json::{Map, Value, json};

/// Scripts that draw time plots, uPlot first.
pub const SCRIPTS: [&str; 4] = [
    include_str!("../../assets/report/uPlot.iife.min.js"),
    include_str!("../../assets/report/path.js"),
    include_str!("../../assets/report/lanes.js"),
    include_str!("../../assets/report/plots.js"),
];
/// Style of uPlot.
pub const UPLOT_STYLE: &str = include_str!("../../assets/report/uPlot.min.css");

/// Colours of flights by their names in the style, and dashes \[px\], by which they differ without colour too.
const LOOKS: [(&str, &[u8]); 6] = [
    ("blue", &[]),
    ("orange", &[9, 4]),
    ("green", &[2, 3]),
    ("pink", &[10, 3, 2, 3]),
    ("olive", &[16, 5]),
    ("muted", &[4, 2, 1, 2, 1, 2]),
];

/// Explanation of how time plots show what happened.
pub const HAPPENED_HINT: &str = "A tinted stretch is a fault while it acts, a grey one a node without a process, a line a moment: an event, or a \
     fault without duration; the lanes under the time axes name them.";

/// Columns of a flight over a time base.
#[derive(Debug, Clone, Serialize)]
pub struct FlightColumns {
    pub rows: usize,
    /// Time of the first row, and between two rows \[s\].
    pub begin_s: f64,
    pub dt_s: f64,
    /// Values by name, see [`column()`].
    pub columns: Map<String, Value>,
}

/// A plot of some series over one axis.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Plot {
    /// Quantity, where the names of the series do not tell it.
    pub title: Option<&'static str>,
    pub unit: &'static str,
    /// Least range worth showing.
    pub span: f64,
    /// `true` if the axis begins at zero.
    pub floor: bool,
    /// Name of the group's horizontal lines that this plot has.
    pub lines: Option<&'static str>,
    pub series: Vec<Series>,
}

/// A column of a flight in a plot.
#[derive(Debug, Clone, Serialize)]
pub struct Series {
    pub label: String,
    pub column: &'static str,
    /// Index of the flight.
    pub flight: usize,
    pub colour: &'static str,
    pub dash: &'static [u8],
}

impl Series {
    /// Makes a series with the colour and dashes of the flight or line number `look`.
    pub fn new(label: &str, column: &'static str, flight: usize, look: usize) -> Self {
        let (colour, dash) = LOOKS[look % LOOKS.len()];
        Self { label: label.into(), column, flight, colour, dash }
    }

    /// Makes the series of a reference, drawn as a broken line.
    pub fn wanted(label: &str, column: &'static str, flight: usize) -> Self {
        Self { label: label.into(), column, flight, colour: "ink", dash: &[5, 4] }
    }
}

/// Plots with one time axis, one cursor and one zoom.
#[derive(Debug, Clone)]
pub struct TimePlots {
    pub flights: Vec<FlightColumns>,
    /// See [`happened`].
    pub happened: Value,
    /// Horizontal lines by name: `y` and `label` of each.
    pub lines: Value,
    pub plots: Vec<Plot>,
    /// `true` to draw the paths too, from the columns `x`, `y`, `z` and `x_wanted`, `y_wanted`, `z_wanted`.
    pub paths: bool,
}

impl TimePlots {
    /// Makes the element of a page whose scripts draw the plots.
    pub fn html(&self) -> String {
        let looked = |(i, flight): (usize, &FlightColumns)| {
            let mut flight = json!(flight);
            if self.flights.len() > 1 {
                let (colour, dash) = LOOKS[i % LOOKS.len()];
                (flight["colour"], flight["dash"]) = (colour.into(), json!(dash));
            }
            flight
        };
        let flights: Value = self.flights.iter().enumerate().map(looked).collect();
        let group = json!({ "flights": flights, "happened": self.happened, "lines": self.lines, "plots": self.plots });
        let paths = if self.paths {
            "<div class=\"paths\"><div class=\"space\"></div><div class=\"plan\"></div></div>"
        } else {
            ""
        };
        format!(
            "<div class=\"time-plots\">{paths}<div class=\"plots\"></div>\
             <script type=\"application/json\">{}</script></div>",
            in_script(&group)
        )
    }
}

/// Formats JSON for a script element, which only `<` could end.
pub fn in_script(json: &Value) -> String {
    json.to_string().replace('<', "\\u003c")
}

/// Encodes a column: base64 of little-endian f32; NaN is a hole.
pub fn column(values: impl IntoIterator<Item = f32>) -> Value {
    let bytes: Vec<u8> = values.into_iter().flat_map(f32::to_le_bytes).collect();
    BASE64_STANDARD.encode(bytes).into()
}

/// Merges the happenings of flights, each given with its name, for one time axis. An item that several flights have is
/// shown once, with their names unless all have it; an item of one flight also gets its colour.
pub fn happened(flights: &[(&str, &Happenings)]) -> Value {
    let (titles, told): (Vec<&str>, Vec<Value>) =
        flights.iter().map(|(title, happened)| (*title, json!(happened))).unzip();
    let kinds = [("faults", "what"), ("absences", "what"), ("phases", "what"), ("events", "node")];
    kinds.into_iter().map(|(kind, named)| (kind, merged(&titles, &told, kind, named))).collect()
}

/// Merges the items of one kind; `named` is the field that gets the names of the flights.
fn merged(titles: &[&str], flights: &[Value], kind: &str, named: &str) -> Value {
    let mut all: Vec<(Value, Vec<usize>)> = vec![];
    for (i, flight) in flights.iter().enumerate() {
        for item in flight[kind].as_array().into_iter().flatten() {
            match all.iter_mut().find(|(known, of)| known == item && !of.contains(&i)) {
                Some((_, of)) => of.push(i),
                None => all.push((item.clone(), vec![i])),
            }
        }
    }
    let told = |(mut item, of): (Value, Vec<usize>)| {
        if of.len() < flights.len() {
            let names: Vec<&str> = of.iter().map(|i| titles[*i]).collect();
            item[named] = format!("{}: {}", names.join(", "), item[named].as_str().unwrap_or_default()).into();
            item["flight"] = of[0].into();
            item["number"] = 0.into(); // numbers repeat from flight to flight
            if let [only] = of[..] {
                item["colour"] = LOOKS[only % LOOKS.len()].0.into();
            }
        }
        item
    };
    all.into_iter().map(told).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use outcome::happenings::Span;

    fn flight(faults: &[(&str, f64)]) -> Happenings {
        let span = |(what, from_s): &(&str, f64)| {
            let mut span = Span::at(*from_s);
            span.what = (*what).into();
            span
        };
        Happenings { faults: faults.iter().map(span).collect(), ..Happenings::default() }
    }

    #[test]
    fn an_item_of_all_flights_is_shown_once_and_others_name_their_flight() {
        let (one, other) = (flight(&[("gust", 1.0), ("kill", 2.0)]), flight(&[("gust", 1.0), ("kill", 3.0)]));
        let told = happened(&[("a", &one), ("b", &other)]);
        let words: Vec<_> = told["faults"].as_array().unwrap().iter().map(|fault| &fault["what"]).collect();
        assert_eq!(words, ["gust", "a: kill", "b: kill"]);
        assert_eq!((&told["faults"][0]["flight"], &told["faults"][2]["flight"]), (&Value::Null, &json!(1)));
        let calm = Happenings::default();
        let some = happened(&[("a", &one), ("b", &other), ("c", &calm)]);
        assert_eq!((&some["faults"][0]["what"], &some["faults"][0]["colour"]), (&json!("a, b: gust"), &Value::Null));
        let alone = happened(&[("a", &one)]);
        assert_eq!(alone["faults"][1]["what"], "kill");
    }

    #[test]
    fn text_cannot_end_the_script_element() {
        let plots = TimePlots {
            flights: vec![],
            happened: happened(&[("a", &flight(&[("</script>", 0.0)]))]),
            lines: Value::Null,
            plots: vec![],
            paths: false,
        };
        assert_eq!(plots.html().matches("</script>").count(), 1);
    }
}
