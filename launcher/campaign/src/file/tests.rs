use super::*;

fn read(text: &str) -> anyhow::Result<Campaign> {
    Campaign::read(text, "x.toml", "x", Path::new(""))
}

#[test]
fn the_merged_file_is_the_same_campaign() {
    let text = "seeds = 3\nsamples = 4\n[settings]\nrun.duration_s = 1.0\n[vary]\n\
                attitude.mpc.prediction_horizon_s = [0.2, 0.3]\n\
                plant.airframe.mass_kg = { uniform = [1.0, 1.2] }\n[controller.a]\nattitude.law = 'lqr'\n\
                [controller.b]\nattitude.law = 'pid'\n";
    let campaign = read(text).unwrap();
    assert_eq!((campaign.flights(), campaign.name()), (3 * 4 * 2 * 2, "x"));
    let again = Campaign::read(&campaign.merged(), "y.toml", "y", Path::new("")).unwrap();
    assert_eq!((again.merged(), again.hash()), (campaign.merged(), campaign.hash()));
    assert_eq!(again.factors, campaign.factors);
    assert_ne!(read(&text.replace("1.2", "1.3")).unwrap().hash(), campaign.hash());
    let limit = "[limit]\nkey = 'run.command_delay_ms'\nfrom = 0.0\nto = 9.0\nresolution = 1.0\n";
    let searched = read(&format!("{text}{limit}")).unwrap();
    assert_eq!(read(&searched.merged()).unwrap().limit(), searched.limit());
    assert_ne!(searched.hash(), campaign.hash(), "a limit changes the flights");
}

#[test]
fn each_case_has_its_scenario_and_its_settings_above_those_of_all() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write(
        "far.toml",
        "[run]\nduration_s = 7.0\n[mission]\ntrajectory = 'hover'\n[bounds]\nmax_position_error_m = 3.0\n",
    );
    write("laws.toml", "[controller.pid]\nattitude.law = 'pid'\n[controller.lqr]\nattitude.law = 'lqr'\n");
    let text = "controllers = 'laws.toml'\n[settings]\nbounds.max_position_error_m = 2.0\n[case.near]\n[case.far]\n\
                scenario = 'far.toml'\nattitude.mpc.prediction_horizon_s = 0.25\n[controller.mpc]\n\
                attitude.law = 'mpc'\n";
    let read = |text: &str| Campaign::read(text, "x.toml", "x", folder.path());
    let campaign = read(text).unwrap();
    let names: Vec<&str> = campaign.controllers.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!((campaign.cases().collect::<Vec<_>>(), names), (vec!["near", "far"], vec!["pid", "lqr", "mpc"]));
    let of = |controller: usize, case: &str| campaign.given(controller, Some(case)).scenario(&[]).unwrap();
    let far = of(1, "far");
    assert_eq!((far.run.duration_s, far.bounds.max_position_error_m, far.np()), (7.0, Some(2.0), 25));
    assert_eq!((far.attitude.law, of(1, "near").np()), (settings::Law::Lqr, settings::Scenario::default().np()));
    let again = Campaign::read(&campaign.merged(), "y.toml", "y", Path::new("")).unwrap();
    assert_eq!((again.merged(), again.flights()), (campaign.merged(), 6), "it needs no other file");
    for (other, expected) in [
        (text.replace("controller.mpc", "controller.pid"), "[controller.pid] stands in"),
        (text.replace("laws.toml", "far.toml"), "far.toml is a scenario"),
        (text.replace("far.toml", "no.toml"), "no.toml"),
        (text.replace("attitude.mpc.prediction_horizon_s = 0.25", "attitude.mpc.npp = 25"), "[case.far]"),
        (text.replace("'far.toml'", "3"), "give the path of a scenario"),
    ] {
        let said = format!("{:#}", read(&other).unwrap_err());
        assert!(said.contains(expected), "{expected}: {said}");
    }
}

#[test]
fn controllers_stand_in_the_order_of_the_file() {
    let names = |campaign: &Campaign| campaign.controllers.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    let campaign =
        read("[controller.pid]\nattitude.law = 'pid'\n[controller.lqr]\nattitude.law = 'lqr'\n[controller.mpc]\n")
            .unwrap();
    assert_eq!(names(&campaign), ["pid", "lqr", "mpc"]);
    assert_eq!(names(&read(&campaign.merged()).unwrap()), ["pid", "lqr", "mpc"]);
}

#[test]
fn a_mistake_in_the_file_is_named_before_anything_is_flown() {
    for (text, expected) in [
        ("sample = 3", "samples"),
        ("profile = 'paper'\n[run]\nduration_s = 3.0", "x.toml is a scenario, which `trefoil fly x.toml` flies once"),
        ("samples = 3", "anything that is drawn"),
        ("samples = 0\n[vary]\nattitude.mpc.max_iterations = { integer = [20, 30] }", "1 or more"),
        ("[vary]\nattitude.mpc.max_iterations = { integer = [20, 30] }", "give `samples`"),
        ("sampling = 'sobol'", "without a distribution"),
        ("sampling = 'sobl'", "sobol"),
        (
            "samples = 100000\nsampling = 'sobol'\n[vary]\nattitude.mpc.max_iterations = { integer = [20, 30] }",
            "latin-hypercube",
        ),
        ("seeds = 0", "`seeds`"),
        ("seeds = 3\n[vary]\nrun.seed = [1]", "varies twice"),
        ("seeds = [1, 2, 1]", "`run.seed` lists 1 twice"),
        (
            "[vary]\n'initial.attitude_deg' = [[0, 0, 0], [9, 0, 0]]\ninitial.attitude_deg.0 = [0, 5]",
            "is a part of `initial.attitude_deg`",
        ),
        ("[vary]\n'initial.attitude_deg'.0 = [0, 5]\ninitial.attitude_deg.0 = [0, 6]", "varies twice"),
        (
            "seeds = 100\n[vary]\nattitude.mpc.max_iterations = { range = { from = 1, to = 9, steps = 1000000 } }",
            "are too many: at most",
        ),
        ("[vary]\nmpc.w = { range = { from = 0, to = 1, steps = 4000000000 } }", "`mpc.w` alone has 4000000000 values"),
        ("seeds = 4000000000", "`run.seed` alone has 4000000000 values"),
        ("[settings]\nattitude.mpc.npp = 3", "unknown key `attitude.mpc.npp`"),
        ("[controller.a]\nattitude.law = 'lqg'", "lqr"),
        (
            "[controller.a]\nattitude.mpc.max_iterations = 20\n[vary]\nattitude.mpc.max_iterations = [20, 30]",
            "[controller.a]",
        ),
        ("[vary]\nrun.mode = ['lockstep']", "in process"),
        ("name = 'a/b'", "`name`"),
        ("scenario = 'none.toml'", "none.toml"),
        ("[random_faults]\ncount = [0, 1]\nat_s = [1, 2]\nfor_s = [1, 2]", "give `samples`"),
    ] {
        let said = format!("{:#}", read(text).unwrap_err());
        assert!(said.contains(expected), "{text}: {said}");
    }
}
