use super::*;

fn truth(tick: u64) -> Truth {
    let mut truth = Truth { tick, sequence: tick + 1, ..Truth::default() };
    truth.actual.position_m = [tick as f64, 0.0, -1.0];
    truth
}

fn shown(scene: &mut Scene, truth: &Truth) -> Vec<SceneChannel> {
    scene.on_record(&truth.with_checksum().into()).into_iter().map(|derived| derived.channel).collect()
}

#[test]
fn the_rates_do_not_grow_with_that_of_the_ring() {
    for rate_hz in [50, 100, 1000] {
        let mut scenario = Scenario::default();
        scenario.run.rate_hz = rate_hz;
        let mut scene = Scene::new(&scenario);
        let mut last = None;
        let mut counts = [0; SceneChannel::ALL.len()];
        for tick in 0..=u64::from(4 * rate_hz) {
            for derived in scene.on_record(&truth(tick).with_checksum().into()) {
                counts[derived.channel as usize] += 1;
                assert_eq!(derived.time_ns, tick * scenario.sample_ns());
                last = Some(derived).filter(|derived| derived.channel == SceneChannel::Frames).or(last);
            }
        }
        let all =
            [SceneChannel::Frames, SceneChannel::Arrows, SceneChannel::Path].map(|channel| counts[channel as usize]);
        // At 50 Hz a twentieth of a second is rounded to three ticks.
        assert_eq!(all, [if rate_hz == 50 { 67 } else { 81 }, 41, 3], "{rate_hz} Hz");
        let frames = FrameTransforms::decode(&last.unwrap().bytes[..]).unwrap();
        let body = &frames.transforms[0];
        assert_eq!((body.parent_frame_id.as_str(), body.child_frame_id.as_str()), ("ned", "body"));
        assert!((body.translation.as_ref().unwrap().x - 4.0 * f64::from(rate_hz)).abs() <= 3.0);
    }
}

#[test]
fn a_truth_that_is_damaged_old_or_not_finite_is_not_shown() {
    let mut scene = Scene::new(&Scenario::default());
    assert_eq!(shown(&mut scene, &truth(0)), [SceneChannel::Frames, SceneChannel::Arrows, SceneChannel::Path]);
    assert!(scene.on_record(&truth(100).into()).is_empty(), "its checksum does not fit");
    let mut off = truth(100);
    off.actual.position_m[0] = f64::NAN;
    assert_eq!(shown(&mut scene, &off), []);
    assert_eq!(shown(&mut scene, &truth(100)), [SceneChannel::Frames, SceneChannel::Arrows]);
    assert_eq!(shown(&mut scene, &truth(100)), [], "a duplicate");
}

#[test]
fn an_event_is_told_with_its_reason_and_a_fault_changes_the_wind() {
    use settings::{Fault, FaultKind, FaultTarget};
    let mut scene = Scene::new(&Scenario::default());
    let told = scene.on_event(&Event::new(250, "mixer", 2, What::Died).because("it was killed"));
    let log = Log::decode(&told.bytes[..]).unwrap();
    assert_eq!((told.time_ns, log.message.as_str()), (2_500_000_000, "mixer epoch 2 died: it was killed"));
    assert_eq!((log.level(), log.name.as_str()), (Level::Error, "mixer"));

    let arrows = |scene: &mut Scene, tick| {
        let derived = scene.on_record(&truth(tick).with_checksum().into());
        let arrows = derived.iter().find(|derived| derived.channel == SceneChannel::Arrows).unwrap();
        SceneUpdate::decode(&arrows.bytes[..]).unwrap().entities.pop().unwrap()
    };
    assert!(arrows(&mut scene, 300).arrows.is_empty(), "calm air");
    let gust = Fault { vector: Some([0.0, 5.0, 0.0]), ..Fault::new(FaultTarget::Wind, FaultKind::Step, 3.0, None) };
    let mut given = Event::new(300, "wind", 0, What::Injected);
    given.fault = Some(Box::new((0, gust)));
    scene.on_event(&given);
    let wind = arrows(&mut scene, 310);
    let arrow = &wind.arrows[0];
    assert!((arrow.shaft_length + arrow.head_length - 5.0 * WIND_M_PER_MPS).abs() < 1e-12);
    assert_eq!(wind.id, "wind");
}
