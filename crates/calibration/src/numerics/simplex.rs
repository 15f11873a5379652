//! The least value of a function of a few variables, without its derivatives.

/// Evaluations after which a search is given up where it stands.
const EVALUATIONS: usize = 90;

/// The point at which `of` is least, and its value there: the simplex of Nelder and Mead (1965), from `begin` and a `step` along
/// each axis, until its corners differ by less than `near`, in place and in value.
pub(crate) fn least(begin: &[f64], step: f64, near: f64, of: &dyn Fn(&[f64]) -> f64) -> (Vec<f64>, f64) {
    let n = begin.len();
    let at = |x: Vec<f64>| {
        let value = of(&x);
        (x, value)
    };
    let mut corners = vec![at(begin.to_vec())];
    for i in 0..n {
        let mut x = begin.to_vec();
        x[i] += step;
        corners.push(at(x));
    }
    for _ in 0..EVALUATIONS {
        corners.sort_by(|a, b| a.1.total_cmp(&b.1));
        let (best, worst) = (corners[0].clone(), corners[n].clone());
        let apart = best.0.iter().zip(&worst.0).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if worst.1 - best.1 < near && apart < near {
            break;
        }
        let middle: Vec<f64> = (0..n).map(|i| corners[..n].iter().map(|c| c.0[i]).sum::<f64>() / n as f64).collect();
        // 1 is the worst corner, −1 its mirror image
        let along = |t: f64| at(middle.iter().zip(&worst.0).map(|(m, w)| m + t * (w - m)).collect());
        let mirrored = along(-1.0);
        let next = if mirrored.1 < best.1 {
            let further = along(-2.0);
            if further.1 < mirrored.1 { further } else { mirrored }
        } else if mirrored.1 < corners[n - 1].1 {
            mirrored
        } else {
            along(if mirrored.1 < worst.1 { -0.5 } else { 0.5 })
        };
        if next.1 < worst.1 {
            corners[n] = next;
        } else {
            for c in &mut corners[1..] {
                *c = at(best.0.iter().zip(&c.0).map(|(b, x)| 0.5 * (b + x)).collect());
            }
        }
    }
    corners.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((begin.to_vec(), f64::INFINITY))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::least;

    #[test]
    fn the_lowest_point_of_a_bent_valley_is_found() {
        let valley = |x: &[f64]| (x[0] - 1.0).powi(2) + 10.0 * (x[1] - x[0] * x[0]).powi(2);
        let (x, value) = least(&[-1.0, 0.5], 0.5, 1e-4, &valley);
        assert!((x[0] - 1.0).abs() < 1e-2 && (x[1] - 1.0).abs() < 2e-2 && value < 1e-4, "{x:?} {value}");
    }

    #[test]
    fn a_flat_direction_does_not_keep_the_others_from_their_place() {
        let (x, _) = least(&[0.0, 5.0, 0.0], 2.0, 1e-3, &|x| (x[0] - 3.0).powi(2) + (x[1] + 2.0).powi(2));
        assert!((x[0] - 3.0).abs() < 0.05 && (x[1] + 2.0).abs() < 0.05, "{x:?}");
    }
}
