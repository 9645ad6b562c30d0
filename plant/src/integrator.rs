//! Classical Runge-Kutta method of fourth order.
//!
//! ```text
//! x[k+1] = x[k] + dt/6 (k1 + 2 k2 + 2 k3 + k4)
//! k1 = f(0, x),  k2 = f(dt/2, x + dt/2 k1),  k3 = f(dt/2, x + dt/2 k2),  k4 = f(dt, x + dt k3)
//! ```

/// Integrates `dx/dt = f(t, x)` from `x` over `dt_s` in one step, with t \[s\] since the beginning of the step.
pub fn step<const N: usize>(x: &[f64; N], dt_s: f64, f: impl Fn(f64, &[f64; N]) -> [f64; N]) -> [f64; N] {
    let k1 = f(0.0, x);
    let k2 = f(dt_s / 2.0, &along(x, dt_s / 2.0, &k1));
    let k3 = f(dt_s / 2.0, &along(x, dt_s / 2.0, &k2));
    let k4 = f(dt_s, &along(x, dt_s, &k3));
    std::array::from_fn(|i| x[i] + dt_s / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
}

fn along<const N: usize>(x: &[f64; N], dt_s: f64, rate: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| x[i] + dt_s * rate[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Error at t = 1 of the oscillator `x'' = -x` from (1, 0), in `n` steps.
    fn error(n: u32) -> f64 {
        let dt = 1.0 / f64::from(n);
        let x = (0..n).fold([1.0, 0.0], |x, _| step(&x, dt, |_, &[x, v]| [v, -x]));
        (x[0] - 1f64.cos()).hypot(x[1] + 1f64.sin())
    }

    #[test]
    fn is_of_fourth_order() {
        let ratio = error(10) / error(20);
        assert!((ratio - 16.0).abs() < 0.5, "halving the step divides the error by {ratio}, not by 16");
    }

    #[test]
    fn is_exact_for_cubics() {
        let [x] = step(&[0.0], 2.0, |t, _| [4.0 * t * t * t]);
        assert!((x - 16.0).abs() < 1e-14);
    }
}
