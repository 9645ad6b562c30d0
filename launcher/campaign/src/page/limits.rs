//! Section "Limits": the value up to which flights pass, for each controller and combination of listed values.

use std::collections::{BTreeMap, HashSet};

use view::draw::{self, Axis, MapCell, escape, short};
use view::table::Table;

use super::bins::{title, unit};
use super::data::CampaignPage;
use crate::file::SEED;
use crate::limit::{FLIGHTS, ISLANDS, LIMIT, Limit, LimitSteps};
use crate::median;

/// Largest number of lines that the terminal shows.
const LINES: usize = 60;

/// Description of the cells of a map.
pub const CELLS: &str = "A cell has the median limit, from dark to bright over the range, and the number of searches (n). \
    A dash says that the flight fails already at the safe end, dots that the limit lies beyond the range.";

/// Limits of one controller at the same listed values, one for each draw.
struct Line<'a> {
    controller: &'a str,
    /// Row of one of the searches, which has the listed values.
    row: usize,
    /// Limits, the worst first.
    limits: Vec<LimitSteps>,
    /// Islands, with the number of draws that have each.
    islands: BTreeMap<String, usize>,
}

/// Limit of a row; `None` if the flight fails already at the safe end.
pub fn of(page: &CampaignPage, limit: &Limit, row: usize) -> LimitSteps {
    page.flights.column(LIMIT)?.number(row).map(|value| limit.step(value))
}

/// Returns the lines: controller by controller, in the order of the searches.
fn lines<'a>(page: &'a CampaignPage<'a>, limit: &Limit) -> Vec<Line<'a>> {
    let mut rows: BTreeMap<(usize, u64), Vec<usize>> = BTreeMap::new();
    for row in (0..page.rows()).filter(|row| page.passed[*row].is_some()) {
        let place = (page.controllers[row], page.evidence.in_first_draw(page.numbers[row]));
        rows.entry(place).or_default().push(row);
    }
    let hash = |row: &usize| page.flights.column("hash").map_or("", |all| all.text(*row));
    let line = |((controller, _), mut rows): ((usize, u64), Vec<usize>)| {
        // If no draw changes the search, all draws are one observation.
        if rows.iter().map(hash).collect::<HashSet<_>>().len() == 1 {
            rows.truncate(1);
        }
        let mut islands = BTreeMap::new();
        for row in &rows {
            let of_row = page.flights.column(ISLANDS).map_or("", |all| all.text(*row));
            for island in of_row.split(", ").filter(|island| !island.is_empty()) {
                *islands.entry(island.to_owned()).or_default() += 1;
            }
        }
        let mut limits: Vec<LimitSteps> = rows.iter().map(|row| of(page, limit, *row)).collect();
        limits.sort_unstable();
        Line { controller: page.names[controller], row: rows[0], limits, islands }
    };
    rows.into_iter().map(line).collect()
}

/// Returns the table of the limits: a row for each [`Line`].
fn table(page: &CampaignPage, limit: &Limit) -> Table {
    let unit = unit(&limit.key).unwrap_or_default();
    let is_sample = page.evidence.is_sample();
    let keys: Vec<&str> = page.plan.listed_axes().into_iter().map(|(key, _)| key).filter(|key| *key != SEED).collect();
    let mut headings = vec!["controller".to_owned()];
    headings.extend(keys.iter().map(|key| title(key)));
    headings.extend(["draws", "median", "95 % interval", "worst", "islands"].map(str::to_owned));
    headings.extend(
        page.observed.iter().map(|observed| format!("below {} {unit}", short(observed.value)).trim_end().to_owned()),
    );
    let row = |line: Line| {
        let Line { controller, row, limits, islands } = line;
        let mut cells = vec![controller.to_owned()];
        let values = keys.iter().map(|key| page.flights.column(key).map_or(String::new(), |all| all.word(row)));
        cells.extend(values);
        let words = |place: usize| limit.words(limits[place], unit);
        let interval = median::interval(limits.len()).filter(|_| is_sample);
        let interval = interval.map(|[low, high]| match [low, high].map(words) {
            [low, high] if low == high => low,
            [low, high] => format!("{low} to {high}"),
        });
        let island = |(value, draws): (&String, &usize)| match draws {
            1 => value.clone(),
            draws => format!("{value} ({draws} draws)"),
        };
        let islands = if islands.is_empty() { vec!["-".to_owned()] } else { islands.iter().map(island).collect() };
        let median = words(median::place(limits.len()));
        cells.extend([limits.len().to_string(), median, interval.unwrap_or("-".into()), words(0), islands.join(", ")]);
        cells.extend(page.observed.iter().map(|observed| {
            let is_below = |steps: &&LimitSteps| limit.is_before(**steps, observed.value);
            limits.iter().filter(is_below).count().to_string()
        }));
        cells
    };
    let title = format!("last value of {} before the first that fails", limit.key);
    let headings: Vec<&str> = headings.iter().map(String::as_str).collect();
    Table::new(&title, &headings, lines(page, limit).into_iter().map(row).collect())
}

/// Returns the table for the terminal.
pub fn text(page: &CampaignPage, limit: &Limit) -> String {
    let mut table = table(page, limit);
    let left_out = table.rows.len().saturating_sub(LINES);
    table.rows.truncate(LINES);
    let more = if left_out > 0 { format!("{left_out} more lines are in campaign.html\n") } else { String::new() };
    table.text() + &more + &observed(page).map_or(String::new(), |words| words + "\n")
}

/// Describes the value of the setting that was observed in real time.
fn observed(page: &CampaignPage) -> Option<String> {
    let (observed, limit) = (page.observed.as_ref()?, page.plan.campaign.limit()?);
    let unit = unit(&limit.key).unwrap_or_default();
    Some(format!("Observed in real time: {} {unit}, the {}.", short(observed.value), observed.words).replace(" ,", ","))
}

/// Returns the sentences on what a limit is, and on its intervals.
pub fn sentences(page: &CampaignPage, limit: &Limit) -> String {
    let unit = unit(&limit.key).unwrap_or_default();
    let Limit { key, from, to, resolution, .. } = limit;
    let grid = limit.grid().len();
    let [from, to, resolution] = [from, to, resolution].map(|value| short(*value));
    let mut words = format!(
        "A limit is the last `{key}` before the first that fails, from {from} to {to} {unit} by {resolution}: {grid} values \
         are flown first, and the first step that fails is bisected. Passes beyond it are islands, which do not count. A \
         failure between two of the {grid} values that both pass is not seen."
    );
    words += match (page.evidence.is_sample(), median::interval(page.evidence.all_draws() as usize)) {
        (true, Some(_)) => {
            " The interval is that of the median over the draws, by order statistics: whatever the distribution, and also \
             with limits beyond the range."
        }
        (true, None) => " The draws are fewer than six, so that the median has no interval.",
        (false, _) => "",
    };
    words.replace("  ", " ")
}

/// Numbers for the head of the page: flights of all searches, and searches that met either end of the range.
pub fn tiles(page: &CampaignPage, limit: &Limit) -> Vec<(String, String)> {
    let rows = || (0..page.rows()).filter(|row| page.passed[*row].is_some());
    let flights: f64 = rows().filter_map(|row| page.flights.column(FLIGHTS)?.number(row)).sum();
    let count = |meant: LimitSteps| rows().filter(|row| of(page, limit, *row) == meant).count().to_string();
    vec![
        ("flights of all searches".to_owned(), short(flights)),
        (format!("fail already at {}", short(limit.from)), count(None)),
        (format!("pass up to {}", short(limit.to)), count(Some(limit.steps()))),
    ]
}

/// Returns the section; empty without `[limit]`.
pub fn section(page: &CampaignPage) -> String {
    let Some(limit) = page.plan.campaign.limit() else { return String::new() };
    let observed = observed(page).map_or(String::new(), |words| format!("<p>{}</p>", escape(&words)));
    let legend = if page.names.len() > 1 { draw::legend(&page.names) } else { String::new() };
    format!(
        "<section id=\"limits\"><h2>Limits</h2>{observed}{}<h3>Distribution</h3><p>The share of searches that pass up to each \
         value of the grid and further, with 95 % intervals over the draws.</p><p class=\"hint\">{legend}</p>{}</section>",
        table(page, limit).html(),
        distribution(page, limit)
    )
}

/// Draws the share of searches whose limit is at least each value of the grid.
fn distribution(page: &CampaignPage, limit: &Limit) -> String {
    let grid = limit.grid();
    let axis = Axis::of_values(&title(&limit.key), grid.iter().map(|step| short(limit.value(*step))).collect());
    let reaches = |row: usize, step: u64| of(page, limit, row).is_some_and(|limit| limit >= step);
    draw::shares("pass", &axis, &page.names, |controller, entry| {
        let rows = (0..page.rows()).filter(|row| page.controllers[*row] == controller && page.passed[*row].is_some());
        let rate = page.evidence.rate(rows.map(|row| (page.numbers[row], reaches(row, grid[entry]))));
        (rate.flights > 0).then(|| rate.picture())
    })
}

/// Median limit of some rows; `None` if none of them could be flown.
pub fn median_of(page: &CampaignPage, limit: &Limit, rows: &[usize]) -> Option<LimitSteps> {
    let flown = rows.iter().filter(|row| page.passed[**row].is_some());
    let mut limits: Vec<LimitSteps> = flown.map(|row| of(page, limit, *row)).collect();
    limits.sort_unstable();
    limits.get(median::place(limits.len())).copied()
}

/// Returns the cell of a median limit, the brighter the farther it lies from the safe end; `None` without a search.
pub fn cell(page: &CampaignPage, limit: &Limit, rows: &[usize], of: &str) -> Option<MapCell> {
    let median = median_of(page, limit, rows)?;
    let words = limit.words(median, unit(&limit.key).unwrap_or_default());
    let label = match median {
        None => draw::DASH.to_owned(),
        Some(step) if step == limit.steps() => format!("{} …", short(limit.to)),
        Some(step) => short(limit.value(step)),
    };
    Some(MapCell {
        shade: median.map_or(0.0, |step| step as f64 / limit.steps() as f64),
        label,
        note: format!("n {}", rows.len()),
        title: format!("{of}: median limit {words}, {} searches", rows.len()),
    })
}
