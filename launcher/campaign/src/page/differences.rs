//! Section "By how much the controllers differ": metrics of `[compare]`, in each case, flight by flight.

use std::collections::BTreeMap;

use view::draw::{escape, short, table};
use view::table::Table;

use super::data::CampaignPage;
use super::pairs::holm;
use crate::difference::MetricDifference;
use crate::file::CASE;

/// Difference of two controllers in a metric, in one case.
struct Row<'a> {
    metric: &'a str,
    case: Option<&'a str>,
    controller: &'a str,
    /// Number of pairs of flights that both passed and have the metric, and number of the other pairs.
    pairs: usize,
    left_out: usize,
    /// Means of the controller, and of the controller that it is compared with.
    means: [f64; 2],
    difference: Option<MetricDifference>,
}

/// Returns the section; empty if the file compares nothing.
pub fn section(page: &CampaignPage) -> String {
    let Some(compare) = page.plan.campaign.compare() else { return String::new() };
    let (headings, rows) = cells(page);
    let rows = rows.into_iter().map(|row| row.iter().map(|cell| escape(cell)).collect());
    format!(
        "<section id=\"differences\"><h2>By how much the controllers differ</h2><p>Each controller less <b>{}</b>, over the pairs of \
         flights that both passed; the others are left out, and a controller that loses its worst flights looks better \
         without them. The interval is that of the mean over the draws (Student\u{2019}s t, 95 %), <i>d</i> the effect size: \
         the mean as a multiple of the draws\u{2019} standard deviation (Cohen\u{2019}s <i>d<sub>z</sub></i>). <i>p</i> allows \
         for the number of rows (Holm).</p>{}</section>",
        escape(&compare.with),
        table(&headings, rows)
    )
}

/// Returns the table for a terminal; empty if the file compares nothing.
pub fn text(page: &CampaignPage) -> String {
    let Some(compare) = page.plan.campaign.compare() else { return String::new() };
    let (headings, rows) = cells(page);
    Table::new(&format!("less {}, where both passed", compare.with), &headings, rows).text()
}

/// Returns headings and cells of the table.
fn cells(page: &CampaignPage) -> (Vec<&'static str>, Vec<Vec<String>>) {
    let rows = rows(page);
    let mut headings = vec!["metric", "case", "controller", "pairs", "left out", "mean", "of the other"];
    let has_cases = page.plan.campaign.cases().next().is_some();
    headings.retain(|heading| has_cases || *heading != "case");
    headings.extend(["difference", "95 % interval", "d", "p, Holm"]);
    let adjusted = adjusted(&rows);
    let line = |(row, p): (&Row, Option<f64>)| {
        let mut cells = vec![row.metric.to_owned()];
        cells.extend(row.case.map(str::to_owned));
        cells.extend([row.controller.to_owned(), row.pairs.to_string(), row.left_out.to_string()]);
        cells.extend(row.means.map(|mean| if mean.is_nan() { "-".into() } else { short(mean) }));
        match row.difference {
            Some(MetricDifference { mean, low, high, effect, .. }) => cells.extend([
                short(mean),
                format!("{} to {}", short(low), short(high)),
                format!("{effect:.2}"),
                p.map_or("-".into(), short),
            ]),
            None => cells.extend(["-", "-", "-", "-"].map(str::to_owned)),
        }
        cells
    };
    let lines = rows.iter().zip(adjusted).map(line).collect();
    (headings, lines)
}

/// Returns Holm's adjusted p-value of each row; `None` for a row without a difference.
fn adjusted(rows: &[Row]) -> Vec<Option<f64>> {
    let p = |row: &usize| rows[*row].difference.map(|difference| difference.p);
    let mut order: Vec<usize> = (0..rows.len()).filter(|row| p(row).is_some()).collect();
    order.sort_by(|one, other| p(one).unwrap_or(1.0).total_cmp(&p(other).unwrap_or(1.0)));
    let rising: Vec<f64> = order.iter().filter_map(p).collect();
    let mut adjusted = vec![None; rows.len()];
    order.into_iter().zip(holm(&rising)).for_each(|(row, p)| adjusted[row] = Some(p));
    adjusted
}

/// Compares each controller in each metric and case.
fn rows<'a>(page: &'a CampaignPage<'a>) -> Vec<Row<'a>> {
    let campaign = &page.plan.campaign;
    let Some(compare) = campaign.compare() else { return vec![] };
    let Some(with) = page.names.iter().position(|name| *name == compare.with) else { return vec![] };
    let named: Vec<Option<&str>> = campaign.cases().map(Some).collect();
    let cases = if named.is_empty() { vec![None] } else { named };
    let column = page.flights.column(CASE);
    let is_in = |row, case: Option<&str>| case.is_none_or(|case| column.is_some_and(|all| all.text(row) == case));
    let mut rows = vec![];
    for metric in &compare.metrics {
        for case in &cases {
            let of_case = page.by_case(|row| is_in(row, *case));
            for controller in (0..page.names.len()).filter(|controller| compare.compares(page.names[*controller])) {
                rows.push(row(page, &of_case, metric, *case, [controller, with]));
            }
        }
    }
    rows
}

fn row<'a>(
    page: &'a CampaignPage<'a>,
    flights: &BTreeMap<u64, Vec<Option<usize>>>,
    metric: &'a str,
    case: Option<&'a str>,
    controllers: [usize; 2],
) -> Row<'a> {
    let column = page.flights.column(metric);
    let value = |row: usize| {
        let value = column.and_then(|column| column.number(row)).filter(|value| value.is_finite());
        value.filter(|_| page.passed[row] == Some(true))
    };
    let (mut values, mut left_out) = (vec![], 0);
    for by_controller in flights.values() {
        let [Some(one), Some(other)] = controllers.map(|controller| by_controller[controller]) else { continue };
        match (value(one), value(other)) {
            (Some(mine), Some(theirs)) => values.push((page.numbers[one], [mine, theirs])),
            _ => left_out += 1,
        }
    }
    let mean = |i: usize| values.iter().map(|(_, pair)| pair[i]).sum::<f64>() / values.len() as f64;
    let more = values.iter().map(|(number, [mine, theirs])| (*number, mine - theirs));
    Row {
        metric,
        case,
        controller: page.names[controllers[0]],
        pairs: values.len(),
        left_out,
        means: [mean(0), mean(1)],
        difference: page.evidence.metric_difference(more),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{Campaign, Plan, local};

    const CAMPAIGN: &str = "samples = 6\n[settings]\nrun.duration_s = 1.0\nmission.trajectory = 'hover'\n\
        initial.velocity_mps = [1.0, 0.0, 0.0]\n[vary]\nplant.airframe.mass_kg = { uniform = [1.05, 1.15] }\n\
        [case.calm]\n[case.windy]\nplant.drag_linear_nspm = [0.2, 0.2, 0.1]\nplant.wind_ned_mps = [[0.0, [4.0, 0.0, 0.0]]]\n\
        [controller.soft]\n[controller.hard]\nguidance.kp_theta = -0.4\n[controller.strict]\nbounds.max_position_error_m = 1e-9\n";

    fn said(compare: &str) -> String {
        let campaign = Campaign::read(&format!("{CAMPAIGN}[compare]\n{compare}"), "x.toml", "x", Path::new(""));
        let plan = match campaign {
            Ok(campaign) => Plan::new(campaign).unwrap(),
            Err(error) => return format!("{error:#}"),
        };
        let table = local::fly_all(&plan);
        let page = CampaignPage::new(&plan, &table);
        let (headings, rows) = cells(&page);
        assert!(section(&page).contains("Each controller less <b>soft</b>"));
        let by_hand = |controller: &str, case: &str| {
            let column = |name: &str| table.column(name).unwrap();
            let of = |name: &str| -> Vec<f64> {
                let is_it = |row: &usize| column("controller").text(*row) == name && column(CASE).text(*row) == case;
                (0..table.rows()).filter(is_it).map(|row| column("max_position_error_m").number(row).unwrap()).collect()
            };
            let more: Vec<f64> = of(controller).iter().zip(of("soft")).map(|(mine, theirs)| mine - theirs).collect();
            short(more.iter().sum::<f64>() / more.len() as f64)
        };
        let place = |heading: &str| headings.iter().position(|is| *is == heading).unwrap();
        for row in rows.iter().filter(|row| row[place("controller")] == "hard") {
            assert_eq!(row[place("difference")], by_hand("hard", &row[place("case")]));
            assert_eq!([&row[place("pairs")], &row[place("left out")]], ["6", "0"]);
        }
        let strict: Vec<_> = rows.iter().filter(|row| row[place("controller")] == "strict").collect();
        assert!(
            strict.iter().all(|row| row[place("left out")] == "6" && row[place("difference")] == "-"),
            "{strict:?}"
        );
        let compared = if compare.contains("controllers") { 1 } else { 2 };
        assert_eq!(rows.len(), 2 * compared, "controllers in two cases");
        text(&page)
    }

    #[test]
    fn controllers_are_compared_in_each_case_over_the_flights_that_both_passed() {
        let text = said("with = 'soft'\nmetrics = ['max_position_error_m']");
        assert!(text.starts_with("less soft, where both passed"), "{text}");
        let one = said("with = 'soft'\ncontrollers = ['hard']\nmetrics = ['max_position_error_m']");
        assert!(one.contains("hard") && !one.contains("strict"), "{one}");
    }

    #[test]
    fn names_that_the_campaign_does_not_have_are_refused() {
        for (compare, part) in [
            ("with = 'pid'\nmetrics = ['flown_s']", "no controller \"pid\"; there are soft, hard, strict"),
            ("with = 'soft'\nmetrics = ['error']", "no metric \"error\"; there are failed_at_s, flown_s"),
            ("with = 'soft'\nmetrics = ['max_altitude_error_vertical_m']", "is `max_altitude_error_m` now"),
            ("with = 'soft'\nmetrics = []", "`metrics` is empty"),
            ("with = 'soft'\ncontrollers = ['pid']\nmetrics = ['flown_s']", "no controller \"pid\""),
            ("with = 'soft'\ncontrollers = ['soft']\nmetrics = ['flown_s']", "with which it compares"),
            ("with = 'soft'\ncontrollers = []\nmetrics = ['flown_s']", "`controllers` is empty"),
        ] {
            assert!(said(compare).contains(part), "{compare}: {}", said(compare));
        }
    }
}
