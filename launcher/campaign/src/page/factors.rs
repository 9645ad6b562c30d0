//! Section "Factors": share passed and position error over each factor.

use statrs::statistics::{Data, OrderStatistics};
use view::draw::{self, Axis, Dots, MapCell, Quartiles, legend, map, short};

use super::bins::{Binned, parts};
use super::data::CampaignPage;
use super::limits;
use super::maps::{cells, share_cell};
use super::words::heading;

/// Largest number of controllers that are told apart by colour; with more, each has a row.
pub const COLOURED: usize = 4;
/// Approximate largest number of dots of a plot.
const DOTS: usize = 2000;
/// Smallest number of values that have quartiles.
const FEWEST: usize = 5;

/// Returns the section; empty if nothing varies.
pub fn section(page: &CampaignPage) -> String {
    let factors: Vec<Binned> = page.factors(parts);
    if factors.is_empty() {
        return String::new();
    }
    let plots: String = factors.iter().map(|factor| one(page, factor)).collect();
    let (mapped, plotted): (Vec<&Binned>, Vec<&Binned>) = factors.iter().partition(|factor| has_rows(page, factor));
    let dots = chosen(page.rows()).filter(|row| page.passed[*row].is_some()).count();
    let mut words = vec![];
    if !plotted.is_empty() {
        words.push(format!(
            "Plots have at the left the share passed with 95 % intervals, and at the right the {} of {dots} flights; an \
             arrow at the upper end is one far above all others. A box holds the middle half of the flights of a value \
             or a part of the range, its thick line is their median, and its whiskers reach to the last flight within \
             1.5 times its height.",
            page.error.words
        ));
        words.extend(page.error.limit.map(|_| "The broken line is the bound.".to_owned()));
    }
    if !mapped.is_empty() {
        words.push(match page.plan.campaign.limit() {
            Some(_) => limits::CELLS.to_owned(),
            None => format!(
                "Maps have at the left the percentage passed and the number of flights (n), and at the right the median \
                 of the {}.",
                page.error.words
            ),
        });
    }
    let colours = if page.names.len() > 1 { legend(&page.names) } else { String::new() };
    let signs = format!("<p class=\"hint\">{colours}&#9679; passed &nbsp; &#215; failed</p>");
    let signs = if plotted.is_empty() { String::new() } else { signs };
    format!(
        "<section id=\"factors\"><h2>Factors</h2><p>Each factor by itself, whatever the others were. {}</p>{signs}{plots}</section>",
        words.join(" ")
    )
}

fn one(page: &CampaignPage, factor: &Binned) -> String {
    let plots = if has_rows(page, factor) { rows(page, factor) } else { shares(page, factor) + &errors(page, factor) };
    format!("<h3>{}</h3><div class=\"plots\">{plots}</div>", heading(&factor.key))
}

/// Returns whether a map with rows is needed: for limits, and for more controllers or words than a plot holds.
fn has_rows(page: &CampaignPage, factor: &Binned) -> bool {
    page.plan.campaign.limit().is_some() || page.names.len() > COLOURED || !(factor.is_number || factor.axis.fits())
}

fn shares(page: &CampaignPage, factor: &Binned) -> String {
    draw::shares("passed", &factor.axis, &page.names, |controller, bin| {
        let rate = page.rate(|row| factor.bin(row) == Some(bin) && page.controllers[row] == controller);
        (rate.flights > 0).then(|| rate.picture())
    })
}

/// Rows that are drawn as dots: all, or about [`DOTS`], whatever regular pattern the rows have.
fn chosen(rows: usize) -> impl Iterator<Item = usize> {
    // Multiples of the golden ratio spread evenly and avoid every regular pattern.
    let place = |row: usize| (row as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) as f64 / u64::MAX as f64;
    (0..rows).filter(move |row| rows <= DOTS || place(*row) * (rows as f64) < DOTS as f64)
}

fn errors(page: &CampaignPage, factor: &Binned) -> String {
    let of_controller = |controller: usize| {
        let value = |row: usize| Some((factor.bin(row)?, page.error.of(row)?));
        let of_it = |row: &usize| page.controllers[*row] == controller;
        let points = chosen(page.rows()).filter(of_it).filter_map(|row| {
            let (entry, error) = value(row)?;
            Some((entry, error, !page.passed[row]?))
        });
        let mut values = vec![vec![]; factor.axis.entries.len()];
        (0..page.rows()).filter(of_it).filter_map(value).for_each(|(entry, error)| values[entry].push(error));
        Dots { points: points.collect(), boxes: values.iter().map(|values| quartiles(values)).collect() }
    };
    let series: Vec<Dots> = (0..page.names.len()).map(of_controller).collect();
    draw::dots(&format!("{} [m]", page.error.words), &factor.axis, page.error.limit, &series)
}

/// Renders maps of share and median error with a row for each controller, or for each word of a factor of words.
fn rows(page: &CampaignPage, factor: &Binned) -> String {
    let names: Vec<String> = page.names.iter().map(|name| (*name).to_owned()).collect();
    let controllers = Axis::of_values("", names);
    let [across, mut up] = if factor.is_number {
        [factor.axis.clone(), controllers]
    } else {
        [controllers, Axis { title: String::new(), ..factor.axis.clone() }]
    };
    // A map counts its rows from below. They are read from above, so their order is reversed.
    up = Axis::of_values("", up.entries.into_iter().rev().collect());
    let last = up.entries.len() - 1;
    let mut flights = vec![vec![vec![]; across.entries.len()]; up.entries.len()];
    for flight in 0..page.rows() {
        let (Some(bin), controller) = (factor.bin(flight), page.controllers[flight]) else { continue };
        let (row, column) = if factor.is_number { (controller, bin) } else { (bin, controller) };
        flights[last - row][column].push(flight);
    }
    let axes = [&across, &up];
    let words = |row: &str, column: &str| format!("{row}, {column}");
    if let Some(limit) = page.plan.campaign.limit() {
        let limits = cells(axes, &flights, |rows, row, column| limits::cell(page, limit, rows, &words(row, column)));
        return map("median limit", axes, &limits, |_, _| false);
    }
    let passed = cells(axes, &flights, |flights, row, column| {
        share_cell(&page.rate_of(flights.iter().copied()), &words(row, column))
    });
    let median_of = |flights: &[usize]| median(flights.iter().filter_map(|row| page.error.of(*row)).collect());
    let medians = || flights.iter().flatten().filter_map(|flights| median_of(flights)).filter(|median| *median > 0.0);
    let [low, high] = [medians().fold(f64::INFINITY, f64::min), medians().fold(0.0, f64::max)];
    let errors = cells(axes, &flights, |flights, row, column| {
        let median = median_of(flights)?;
        let shade = if high > low { libm::log(median / low) / libm::log(high / low) } else { 0.5 };
        let label = two_digits(median);
        let title = format!("{row}, {column}: median {label} m of {} flights", flights.len());
        Some(MapCell { shade, label, note: String::new(), title })
    });
    let title = format!("median {} [m]", page.error.words);
    map("passed [%]", axes, &passed, |_, _| false) + &map(&title, axes, &errors, |_, _| false)
}

/// Returns quartiles and whiskers; quantiles of type 8 of Hyndman and Fan (The American Statistician 50, 1996).
fn quartiles(values: &[f64]) -> Option<Quartiles> {
    if values.len() < FEWEST {
        return None;
    }
    let mut data = Data::new(values.to_vec());
    let quartiles = [0.25, 0.5, 0.75].map(|share| data.quantile(share));
    let [first, _, third] = quartiles;
    let whisker = 1.5 * (third - first);
    let within = || values.iter().copied().filter(|value| (first - whisker..=third + whisker).contains(value));
    Some(Quartiles { reach: [within().fold(first, f64::min), within().fold(third, f64::max)], quartiles })
}

fn median(values: Vec<f64>) -> Option<f64> {
    (!values.is_empty()).then(|| Data::new(values).median())
}

/// Formats a number above 0 with two significant digits; from 100 on with all digits before the point.
fn two_digits(value: f64) -> String {
    let step = libm::pow(10.0, (libm::log10(value).floor() - 1.0).min(0.0));
    short((value / step).round() * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_controller_has_its_share_of_the_dots() {
        assert_eq!(chosen(5).count(), 5);
        let rows: Vec<usize> = chosen(12_000).collect();
        assert!(rows.len().abs_diff(DOTS) < 5, "{}", rows.len());
        for controller in 0..12 {
            let share = rows.iter().filter(|row| *row % 12 == controller).count();
            assert!(share.abs_diff(DOTS / 12) < 10, "{share} of controller {controller}");
        }
    }

    /// Reference: R's `quantile(c(1:9, 100), c(.25, .5, .75), type = 8)`.
    #[test]
    fn val_a_box_has_the_quartiles_and_leaves_the_outlier_out() {
        let mut values: Vec<f64> = (1..=9).map(f64::from).collect();
        values.push(100.0);
        let Quartiles { reach, quartiles: [first, median, third] } = quartiles(&values).unwrap();
        assert!((first - 2.916_667).abs() < 1e-6 && (third - 8.083_333).abs() < 1e-6, "{first} {third}");
        assert_eq!((reach, median), ([1.0, 9.0], 5.5));
        assert_eq!(quartiles(&[1.0; 4]), None, "too few");
    }
}
