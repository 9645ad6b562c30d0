//! What went wrong, on the page.

use serde_json::json;

use super::*;

#[test]
fn a_quiet_flight_says_nothing_of_faults() {
    let mut run = survey();
    run["faults"] = json!([]);
    run["events"] = json!([]);
    run["refused"] = json!({ "mixer": { "epoch": 0, "order": 0, "age": 0, "range": 0, "checksum": 0 } });
    let page = render(&hover(2), &run, &Scenario::from(Profile::Robust));
    assert!(!page.contains("#faults") && !page.contains("id=\"faults\""));
    assert_eq!(data(&page)["happened"], json!({ "faults": [], "absences": [], "events": [] }));
}

#[test]
fn faults_and_events_are_told_and_drawn() {
    let mut run = survey();
    run["faults"] = json!([
        { "target": "mixer", "kind": "kill", "injected_at_s": 2.0, "ended_at_s": 2.3, "detected_after_s": 0.0 },
        { "target": "wind", "kind": "step", "injected_at_s": 5.0, "ended_at_s": null },
        { "target": "tilt", "kind": "off", "at_s": 99.0, "injected_at_s": null },
    ]);
    run["events"] = json!([
        { "at_s": 2.0, "node": "mixer", "epoch": 1, "what": "died" },
        { "at_s": 2.31, "node": "mixer", "epoch": 2, "what": "rejected", "why": "too <slow>" },
    ]);
    run["refused"] = json!({ "mixer": { "epoch": 3, "order": 0 }, "guidance": { "epoch": 0 } });
    let page = render(&hover(2), &run, &Scenario::from(Profile::Robust));
    let drawn = &data(&page)["happened"];
    let faults = json!([
        { "number": 1, "what": "mixer kill", "from_s": 2.0, "to_s": 2.3 },
        { "number": 2, "what": "wind step", "from_s": 5.0, "to_s": null },
    ]);
    assert_eq!(drawn["faults"], faults);
    assert_eq!(drawn["absences"], json!([{ "number": 0, "what": "mixer was down", "from_s": 2.0, "to_s": null }]));
    assert_eq!(drawn["events"][1], json!({ "at_s": 2.31, "node": "mixer", "what": "rejected", "why": "too <slow>" }));
    let page = unlabelled(&page);
    for told in [
        "<a href=\"#faults\">What happened</a>",
        "<td>1</td><td>mixer</td><td>kill</td><td>2.00</td><td>2.30</td><td>0.00</td><td>not recovered</td>",
        "<td>2</td><td>wind</td><td>step</td><td>5.00</td><td>the end</td><td>no message shows harm</td><td>–</td>",
        "<td>3</td><td>tilt</td><td>off</td><td>not struck</td><td>–</td><td>–</td><td>–</td>",
        "<td>2.00</td><td>mixer</td><td>1</td><td>died</td><td>–</td>",
        "<td>2.31</td><td>mixer</td><td>2</td><td>rejected</td><td>too &lt;slow&gt;</td>",
        "<td>mixer</td><td>3</td><td>–</td><td>–</td><td>–</td><td>–</td>",
    ] {
        assert!(page.contains(told), "{told}");
    }
    assert!(!page.contains("<td>guidance</td><td>–</td>"), "it refused nothing");
}
