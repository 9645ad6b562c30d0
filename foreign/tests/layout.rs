//! A C and a C++ compiler lay out the types of `trefoil.h` as Rust does.

use std::fmt::Write;
use std::mem::{offset_of, size_of};
use std::path::Path;
use std::process::Command;

use foreign::abi::{
    TrefoilAttitudeAnswer, TrefoilAttitudeInput, TrefoilDemand, TrefoilGuidanceAnswer, TrefoilGuidanceInput,
    TrefoilMixerAnswer, TrefoilMixerInput, TrefoilNode, TrefoilPlantAnswer, TrefoilPlantInput, TrefoilReference,
    TrefoilSample, TrefoilSetup,
};

/// Writes assertions in C of the size of types, and of the place of every field.
macro_rules! assertions {
    ($text:ident: $($type:ident { $($field:ident),* $(,)? })*) => {$(
        let size = size_of::<$type>();
        writeln!($text, "static_assert(sizeof({0}) == {size}, \"{0}\");", stringify!($type)).unwrap();
        $(
            let (name, at) = (stringify!($type), offset_of!($type, $field));
            writeln!($text, "static_assert(offsetof({name}, {0}) == {at}, \"{name}.{0}\");", stringify!($field)).unwrap();
        )*
        // This pattern compiles only if all fields are named.
        let _ = |it: $type| { let $type { $($field: _),* } = it; };
    )*};
}

#[test]
fn c_and_cpp_have_the_layout_of_rust() {
    let mut text = "#include <assert.h>\n#include <stddef.h>\n#include \"trefoil.h\"\n".to_owned();
    assertions! { text:
        TrefoilSetup {
            settings_json, dt_s, g_mps2, mass_kg, inertia_kgm2, arms_m, kf, km, trim_rotor_speed, trim_tilt_rad,
            trim_roll_rad, start_position_m, start_velocity_mps, start_attitude_rad, start_rates_radps,
        }
        TrefoilSample { age_ticks, position_m, velocity_mps, attitude_rad, rates_radps, rotor_speed, tilt_rad }
        TrefoilReference {
            age_ticks, position_m, velocity_mps, attitude_rad, rates_radps, w_mps, preview_step_s, preview,
        }
        TrefoilDemand { age_ticks, demand }
        TrefoilGuidanceInput { tick, time_s, sample }
        TrefoilGuidanceAnswer { position_m, velocity_mps, attitude_rad, rates_radps, w_mps }
        TrefoilAttitudeInput { tick, time_s, sample, reference }
        TrefoilAttitudeAnswer { demand, status }
        TrefoilMixerInput { tick, time_s, sample, demand }
        TrefoilMixerAnswer { rotor_speed, tilt_rad }
        TrefoilPlantInput { tick, time_s, advance_s, rotor_speed, tilt_rad }
        TrefoilPlantAnswer { position_m, velocity_mps, attitude_rad, rates_radps, rotor_speed, tilt_rad }
        TrefoilNode { abi, input_bytes, answer_bytes, memory_bytes, create, step, snapshot, restore, destroy }
    }
    let folder = tempfile::tempdir().unwrap();
    let include = Path::new(env!("CARGO_MANIFEST_DIR")).join("include");
    for (compiler, ending, standard) in [("cc", "c", "-std=c11"), ("c++", "cpp", "-std=c++17")] {
        let file = folder.path().join("layout").with_extension(ending);
        std::fs::write(&file, &text).unwrap();
        let mut command = Command::new(compiler);
        command.args(["-fsyntax-only", "-Wall", "-Wextra", "-Wpedantic", "-Werror", standard, "-I"]);
        let output = match command.arg(&include).arg(&file).output() {
            Ok(output) => output,
            Err(error) if ending == "cpp" => {
                runtime::console::eprint_line(&format!("skipped: no C++ compiler ({error})"));
                continue;
            }
            Err(error) => panic!("the C compiler that Rust links with: {error}"),
        };
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}
