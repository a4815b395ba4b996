//! How a handle is loaded, in the words and limits that every picture of a recording shares.

/// How a handle is loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Load {
    /// It carries.
    Loaded,
    /// It carries less than a tenth of its fair share M·g/N: for two handles, the paper's 0.05·M·g.
    NearlyUnloaded,
    /// It does not touch.
    Slack,
    /// Tied to its shoulder, it is pulled down by more than that tenth.
    Pulled,
}

impl Load {
    /// The state of a handle that presses with `normal_n` (N), of `handles` that share `weight_n` (N). Exactly 0 is slack, and so is NaN.
    pub fn of(normal_n: f64, weight_n: f64, handles: usize) -> Self {
        let little_n = 0.1 * weight_n / handles.max(1) as f64;
        if normal_n.is_nan() || normal_n == 0.0 {
            Load::Slack
        } else if normal_n >= little_n {
            Load::Loaded
        } else if normal_n > -little_n {
            Load::NearlyUnloaded
        } else {
            Load::Pulled
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Load;

    #[test]
    fn two_handles_have_the_papers_line() {
        let weight_n = 600.0;
        for (normal_n, handles, load) in [
            (0.0, 2, Load::Slack),
            (-1.0, 2, Load::NearlyUnloaded),
            (-31.0, 2, Load::Pulled),
            (f64::NAN, 2, Load::Slack),
            (29.9, 2, Load::NearlyUnloaded),
            (30.0, 2, Load::Loaded),
            (7.4, 8, Load::NearlyUnloaded),
            (7.6, 8, Load::Loaded),
        ] {
            assert_eq!(
                Load::of(normal_n, weight_n, handles),
                load,
                "{normal_n} N of {handles}"
            );
        }
    }
}
