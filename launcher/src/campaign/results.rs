//! Results of a campaign from its finished shards: the summary for the terminal, the page and the table.

use std::path::Path;

use anyhow::Context;
use campaign::folder::CampaignFolder;
use campaign::observed::Observed;
use campaign::page::{self, CampaignPage, differences, limits, promises};
use campaign::row::Standing;
use campaign::{Plan, Rate};
use contract::exit;
use flight::interrupts::end_at_once;
use outcome::target::TargetVerdict;
use runtime::console::{eprint_line, print};
use view::table;

/// Parts of the results that come from the command line.
pub struct ResultsView {
    /// Command that flies one flight again, without the number of the flight at its end.
    pub again: String,
    observed: Option<Observed>,
}

impl ResultsView {
    pub fn new(again: String, plan: &Plan, observed: Option<&Path>) -> anyhow::Result<Self> {
        let read = |run: &Path| {
            let limit =
                plan.campaign.limit().context("--observed stands beside limits, and the campaign has no [limit]")?;
            Observed::read(run, &limit.key)
        };
        Ok(Self { again, observed: observed.map(read).transpose()? })
    }
}

/// Writes the results of the shards that are there and prints a summary; returns the exit code.
pub fn conclude(plan: &Plan, folder: &CampaignFolder, shown: &ResultsView) -> anyhow::Result<u8> {
    end_at_once(
        "interrupted before the results were written; the shards are there, and the same command continues".into(),
    );
    let (flights, missing) = folder.collect(plan)?;
    let count = |verdict: Standing| {
        let verdicts = flights.column("verdict");
        (0..flights.rows()).filter(|row| verdicts.is_some_and(|all| all.text(*row) == verdict.name())).count()
    };
    let [passed, failed, invalid] = Standing::ALL.map(count);
    let verdicts = match plan.campaign.limit() {
        Some(_) => format!("{failed} fail at the safe end, {invalid} invalid"),
        None => format!("{passed} passed, {failed} failed, {invalid} invalid"),
    };
    let mut text = format!("{}: {} {}: {verdicts}\n", plan.campaign.name(), flights.rows(), plan.campaign.units());
    let page = CampaignPage { observed: shown.observed.clone(), ..CampaignPage::new(plan, &flights) };
    text += &match plan.campaign.limit() {
        Some(limit) => limits::text(&page, limit) + &page.grounds().join("\n") + "\n",
        None => rates(&page) + &differences::text(&page),
    };
    let targets = promises::targets(&page);
    for target in &targets {
        text += &(target.line().trim_end().to_owned() + "\n");
    }
    print(&text);
    let write = || -> anyhow::Result<()> {
        folder.dir.write_whole("campaign.html", page::page(&page, &shown.again)?.as_bytes())?;
        let whole = "flights.parquet";
        match missing.is_empty() {
            true => folder.dir.write_whole(whole, &flights.to_parquet(&[])?)?,
            false if folder.dir.has(whole) => folder.dir.remove(whole)?, // some of its shards are missing now
            false => {}
        }
        Ok(())
    };
    if let Err(error) = write() {
        eprint_line(&format!("error: {error:#}"));
        return Ok(exit::PROCESS_LOST);
    }
    print(&format!(
        "written to {}: campaign.html{}\n",
        folder.dir.path().display(),
        if missing.is_empty() { ", flights.parquet" } else { "" }
    ));
    if !missing.is_empty() {
        let numbers: Vec<String> = missing.iter().take(8).map(u64::to_string).collect();
        let more = if missing.len() > numbers.len() { ", ..." } else { "" };
        let (all, of) = (missing.len(), folder.layout.shards);
        eprint_line(&format!(
            "{all} of {of} shards are missing ({}{more}): `trefoil campaign` flies them",
            numbers.join(", ")
        ));
        return Ok(exit::PROCESS_LOST);
    }
    if invalid > 0 {
        eprint_line(&format!("{invalid} flights could not be flown: the column `outcome` says why"));
    }
    let is_broken = targets.iter().any(|target| target.verdict == TargetVerdict::Short);
    Ok(if invalid > 0 || is_broken { exit::OUT_OF_BOUNDS } else { exit::FLOWN })
}

/// Returns the table of how many flights each controller passes, and sentences that say what these rates are based on.
fn rates(page: &CampaignPage) -> String {
    let row = |(name, rate): (&str, Rate)| {
        let share = if rate.flights == 0 { "-".into() } else { format!("{:.1} %", 100.0 * rate.share) };
        let Rate { survived, flights, draws, .. } = rate;
        vec![name.to_owned(), survived.to_string(), flights.to_string(), draws.to_string(), share, rate.interval()]
    };
    let rows = page.rates().into_iter().map(row).collect();
    let headings = ["", "passed", "of", "draws", "share", "interval"];
    let table = table::Table::new("passed, and the 95 % interval over the draws", &headings, rows).text();
    table + &page.grounds().join("\n") + "\n"
}
