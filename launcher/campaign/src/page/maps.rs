//! Section "Two factors": a map of the share passed over each pair of factors, with the border of sure differences.

use std::collections::HashSet;

use view::draw::{Axis, MapCell, map};

use super::bins::{Binned, parts_of_two};
use super::data::CampaignPage;
use super::limits;
use super::words::heading;
use crate::Rate;
use crate::variation::Values;

/// Number of factors whose pairs may have a map: those with the largest statistically sure effect on the share.
const MAPPED: usize = 6;
/// Largest number of axis entries of a factor in a map.
const ENTRIES: usize = 10;
/// Largest number of maps of the page, unless there are more controllers.
const MAPS: usize = 12;

/// Returns the section; empty if there is no pair of factors.
pub fn section(page: &CampaignPage) -> String {
    let mut factors = page.factors(parts_of_two);
    factors.retain(|factor| factor.axis.entries.len() <= ENTRIES);
    let mut by_effect: Vec<(f64, &Binned)> = factors.iter().map(|factor| (effect(page, factor), factor)).collect();
    by_effect.sort_by(|a, b| b.0.total_cmp(&a.0));
    by_effect.truncate(MAPPED);
    let mut pairs: Vec<[(f64, &Binned); 2]> = vec![];
    for (i, one) in by_effect.iter().enumerate() {
        pairs.extend(by_effect[i + 1..].iter().map(|other| [*one, *other]));
    }
    pairs.sort_by(|a, b| (b[0].0 + b[1].0).total_cmp(&(a[0].0 + a[1].0)));
    let all = factors.len() * factors.len().saturating_sub(1) / 2;
    pairs.truncate((MAPS / page.names.len()).max(1));
    if pairs.is_empty() {
        return String::new();
    }
    let (mut maps, mut rules) = (String::new(), HashSet::new());
    for [(_, across), (_, up)] in &pairs {
        let is_grid = [across, up].iter().all(|factor| is_listed(page, factor));
        rules.insert(is_grid);
        let of_controllers = (0..page.names.len()).map(|controller| one(page, controller, [across, up], is_grid));
        let heading = [heading(&across.key), heading(&up.key)].join(" and ");
        maps += &[&format!("<h3>{heading}</h3><div class=\"plots\">"), &*of_controllers.collect::<String>(), "</div>"]
            .concat();
    }
    let left_out = if pairs.len() < all {
        format!(" Shown are {} of {all} pairs of factors: those over which the share changes most surely.", pairs.len())
    } else {
        String::new()
    };
    let apart = if rules.contains(&false) {
        " The orange line is the border: it lies between neighbours whose 95 % intervals are apart. Where there is none, \
         no difference between neighbours is sure."
    } else {
        ""
    };
    let half = if rules.contains(&true) {
        " In a grid of listed values the orange line lies between less than half passed and the rest."
    } else {
        ""
    };
    let cells = match page.plan.campaign.limit() {
        Some(_) => limits::CELLS.to_owned(),
        None => format!(
            "Each cell has the percentage passed, from dark (0) to bright (100), and the number of flights (n), whatever \
             the other factors were.{apart}{half}"
        ),
    };
    format!(
        "<section id=\"maps\"><h2>Two factors</h2><p>{cells} A cell without flights is left out.{left_out}</p>{maps}</section>"
    )
}

/// Returns whether a factor is a list, of which each value is flown with each value of the others.
fn is_listed(page: &CampaignPage, factor: &Binned) -> bool {
    let own = page.plan.campaign.factors.iter().find(|own| own.key == factor.key);
    own.is_some_and(|own| matches!(own.values, Values::Listed(_)))
}

/// Statistically sure effect of a factor: the largest gap between the intervals of two entries; below 0 if all overlap.
/// For limits the largest difference of two medians.
fn effect(page: &CampaignPage, factor: &Binned) -> f64 {
    if let Some(limit) = page.plan.campaign.limit() {
        let of = |bin: usize| (0..page.rows()).filter(|row| factor.bin(*row) == Some(bin)).collect::<Vec<_>>();
        let medians = (0..factor.axis.entries.len()).filter_map(|bin| limits::median_of(page, limit, &of(bin)));
        let steps: Vec<f64> = medians.map(|median| median.map_or(-1.0, |step| step as f64)).collect();
        let [least, most] =
            [steps.iter().copied().fold(f64::INFINITY, f64::min), steps.iter().copied().fold(-1.0, f64::max)];
        return most - least;
    }
    let rates = (0..factor.axis.entries.len()).map(|bin| page.rate(|row| factor.bin(row) == Some(bin)));
    // Without draws there is no interval, so the shares themselves are compared.
    let ends = |rate: Rate| if rate.draws == 0 { [rate.share; 2] } else { [rate.low, rate.high] };
    let [low, high] =
        rates.map(ends).fold([0.0_f64, 1.0_f64], |[low, high], ends| [low.max(ends[0]), high.min(ends[1])]);
    low - high
}

fn one(page: &CampaignPage, controller: usize, [across, up]: [&Binned; 2], is_grid: bool) -> String {
    let [columns, rows] = [across, up].map(|factor| factor.axis.entries.len());
    let mut of_cells = vec![vec![vec![]; columns]; rows];
    for row in (0..page.rows()).filter(|row| page.controllers[*row] == controller) {
        if let (Some(column), Some(line)) = (across.bin(row), up.bin(row)) {
            of_cells[line][column].push(row);
        }
    }
    let title = if page.names.len() > 1 { page.names[controller] } else { "" };
    let axes = [&across.axis, &up.axis];
    let words = |of_up: &str, of_across: &str| format!("{of_across}, {of_up}");
    if let Some(limit) = page.plan.campaign.limit() {
        let limits = cells(axes, &of_cells, |rows, up, across| limits::cell(page, limit, rows, &words(up, across)));
        return map(title, axes, &limits, |_, _| false);
    }
    let rate = |rows: &Vec<usize>| page.rate_of(rows.iter().copied());
    let rates: Vec<Vec<Rate>> = of_cells.iter().map(|line| line.iter().map(rate).collect()).collect();
    let shares = cells(axes, &rates, |rate, up, across| share_cell(rate, &words(up, across)));
    let border = |one: [usize; 2], other: [usize; 2]| {
        let [one, other] = [one, other].map(|[row, column]| &rates[row][column]);
        are_apart(one, other) || is_grid && (one.share < 0.5) != (other.share < 0.5)
    };
    map(title, axes, &shares, border)
}

/// Makes the cells of a map; `cell` gets the value of a row and column, and their entries.
pub fn cells<T>(
    [across, up]: [&Axis; 2],
    known: &[Vec<T>],
    cell: impl Fn(&T, &str, &str) -> Option<MapCell>,
) -> Vec<Vec<Option<MapCell>>> {
    let row = |(row, of_row): (&Vec<T>, &String)| {
        row.iter().zip(&across.entries).map(|(known, of_column)| cell(known, of_row, of_column)).collect()
    };
    known.iter().zip(&up.entries).map(row).collect()
}

/// Returns whether two intervals are disjoint; always `false` without draws, because their ends are NaN.
fn are_apart(one: &Rate, other: &Rate) -> bool {
    one.low > other.high || other.low > one.high
}

/// Returns the cell of a share: percent and number of flights; `None` without a flight.
pub fn share_cell(rate: &Rate, of: &str) -> Option<MapCell> {
    let Rate { survived, flights, .. } = rate;
    (*flights > 0).then(|| MapCell {
        shade: rate.share,
        label: format!("{:.0}", 100.0 * rate.share),
        note: format!("n {flights}"),
        title: format!("{of}: {survived} of {flights} passed, 95 % interval {}", rate.interval()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_between_few_flights_is_not_sure() {
        let differ = |a: [usize; 2], b: [usize; 2]| are_apart(&Rate::of(a[0], a[1]), &Rate::of(b[0], b[1]));
        assert!(!differ([2, 2], [0, 2]) && !differ([18, 20], [12, 20]));
        assert!(differ([18, 20], [4, 20]) && differ([0, 20], [20, 20]));
    }
}
