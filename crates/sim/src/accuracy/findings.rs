//! What a study says: the Pareto front, the cheapest setting for a wish, and sentences for people.

use super::{AGREE, ARCHIVE, Judge, Rung, Study};

impl Study {
    /// The error that rungs are ranked by, rad or m.
    pub fn error(&self, r: &Rung) -> f64 {
        match self.judge {
            Judge::Roll => r.error_roll_rad,
            Judge::Height => r.error_z_m,
            Judge::Other | Judge::Nothing => r.error_other,
        }
    }

    /// How far the references themselves may be off, in the unit of [`Self::error`].
    pub fn estimated_error(&self) -> f64 {
        match self.judge {
            Judge::Roll => self.estimated_error_rad,
            Judge::Height => self.estimated_error_m,
            Judge::Other | Judge::Nothing => self.estimated_error_other,
        }
    }

    /// Errors below what the references know are alike.
    fn known(&self, r: &Rung) -> f64 {
        self.error(r).max(self.estimated_error()).max(1e-16)
    }

    pub(super) fn pareto(&self) -> Vec<usize> {
        if self.judge == Judge::Nothing {
            return Vec::new();
        }
        let mut by_time: Vec<usize> = (0..self.runs.len())
            .filter(|&i| self.runs[i].failed.is_none())
            .collect();
        by_time.sort_by(|&a, &b| self.runs[a].cpu_s.total_cmp(&self.runs[b].cpu_s));
        let mut least = f64::INFINITY;
        by_time.retain(|&i| {
            let error = self.known(&self.runs[i]);
            let better = error < least;
            least = least.min(error);
            better
        });
        by_time
    }

    /// The rung of the paper's archive.
    pub fn archive(&self) -> Option<&Rung> {
        self.runs.iter().find(|r| (r.method, r.setting) == ARCHIVE)
    }

    /// The cheapest rung whose error stays within `error`, and that of x, y, pitch and yaw, if the references know them that well.
    pub fn cheapest(&self, error: f64) -> Option<&Rung> {
        let known = self.estimated_error().max(self.estimated_error_other);
        if self.judge == Judge::Nothing || known > error {
            return None;
        }
        self.cheapest_where(|r| self.error(r).max(r.error_other) <= error)
    }

    /// The cheapest rung that is right and stays right on every finer rung of its method: one that is right by luck is none.
    fn cheapest_where(&self, right: impl Fn(&Rung) -> bool) -> Option<&Rung> {
        let ran = || self.runs.iter().filter(|r| r.failed.is_none());
        let stays = |r: &Rung| {
            ran()
                .filter(|f| f.method == r.method && f.setting <= r.setting)
                .all(&right)
        };
        ran()
            .filter(|r| stays(r))
            .min_by(|a, b| a.cpu_s.total_cmp(&b.cpu_s))
    }

    /// What a further digit costs: the factor in time per factor ten in error along the front (least squares in logarithms);
    /// `None` with fewer than two points.
    pub fn cost_of_a_digit(&self) -> Option<f64> {
        let points: Vec<(f64, f64)> = self
            .front
            .iter()
            .map(|&i| {
                (
                    -self.known(&self.runs[i]).log10(),
                    self.runs[i].cpu_s.log10(),
                )
            })
            .collect();
        let mean =
            |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
        let (mx, my) = (mean(|p| p.0), mean(|p| p.1));
        let spread: f64 = points.iter().map(|p| (p.0 - mx).powi(2)).sum();
        let joint: f64 = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
        (points.len() > 1 && spread > 0.0).then(|| 10f64.powf(joint / spread))
    }

    /// How well the references agree, in one sentence.
    pub fn agreement(&self) -> String {
        let agree = format!(
            "they agree to {:.1e} rad in roll, {:.1e} m in height and {:.1e} (m, rad) in x, y, pitch and yaw",
            self.estimated_error_rad, self.estimated_error_m, self.estimated_error_other
        );
        if self.parted {
            format!(
                "{agree} up to t = {:.2} s; then the motion is chaotic, they part by more than {AGREE:.0e}, and no error is judged",
                self.judged_s
            )
        } else {
            agree
        }
    }

    /// What is cheapest, in one sentence.
    pub fn sentence(&self) -> String {
        let truth = self.quoted.rms_roll_rad;
        let others = |r: &Rung| r.other_part <= 0.01;
        let rolls = |r: &Rung| (r.quoted.rms_roll_rad - truth).abs() <= 0.01 * truth;
        let (what, cheapest) = match self.judge {
            Judge::Roll => (
                "RMS roll to 1 %",
                self.cheapest_where(|r| rolls(r) && others(r)),
            ),
            Judge::Height => ("the height to 1 mm", self.cheapest(1e-3)),
            Judge::Other => (
                "x, y, pitch and yaw to 1 % of how far they go",
                self.cheapest_where(others),
            ),
            Judge::Nothing => return "nothing moves, so no setting can be judged".into(),
        };
        let beside = match self.judge {
            Judge::Roll if self.others_move => {
                ", with x, y, pitch and yaw to 1 % of how far they go"
            }
            Judge::Height if self.others_move => ", with x, y, pitch and yaw to 1e-3 m or rad",
            _ => "",
        };
        // Where more follows, what stands beside is set off on both sides.
        let set_off = if beside.is_empty() { "" } else { "," };
        let digit = self
            .cost_of_a_digit()
            .map(|c| {
                format!(
                    "; each further digit of {} costs × {c:.2}",
                    self.judge.name().0
                )
            })
            .unwrap_or_default();
        match cheapest {
            Some(r) => format!(
                "for {what}{beside}{set_off} the cheapest is {} at {}: {:.2} ms{digit}",
                r.method,
                r.setting_text(),
                r.cpu_s * 1e3
            ),
            None => format!("no setting gives {what}{beside}{digit}"),
        }
    }

    /// What the archive's method got right and wrong, in one sentence.
    pub fn archive_sentence(&self) -> String {
        let Some(r) = self.archive() else {
            return "the archive's method is not in the table".into();
        };
        let (it, true_) = (&r.quoted, &self.quoted);
        let name = format!("the archive's {} at {}", r.method, r.setting_text());
        if let Some(cause) = &r.failed {
            return format!("{name} fails: {cause}");
        }
        let degrees = f64::to_degrees;
        let onset = |o: Option<f64>| o.map_or("none".into(), |t| format!("{t:.2} s"));
        let off = if true_.rms_roll_rad > 0.0 {
            let part = it.rms_roll_rad / true_.rms_roll_rad - 1.0;
            format!(" ({:+.2} %)", 100.0 * part)
        } else {
            String::new()
        };
        format!(
            "{name} takes {:.2} ms and errs by up to {:.2e} rad in roll, {:.2e} m in height, {:.2e} (m, rad) in x, y, pitch and yaw and {:.2e} N in a handle's force; \
             it quotes RMS roll {:.4}° for {:.4}°{off}, contact loss {:.4} for {:.4}, onset {} for {}, T_float {:.4} for {:.4}",
            r.cpu_s * 1e3,
            r.error_roll_rad,
            r.error_z_m,
            r.error_other,
            r.error_normal_n,
            degrees(it.rms_roll_rad),
            degrees(true_.rms_roll_rad),
            it.contact_loss,
            true_.contact_loss,
            onset(it.onset_s),
            onset(true_.onset_s),
            it.t_float,
            true_.t_float,
        )
    }
}

impl Rung {
    /// `tolerance 1e-3`, or `step 1 ms`.
    pub fn setting_text(&self) -> String {
        if self.adaptive {
            format!("tolerance {:.0e}", self.setting)
        } else {
            format!("step {} ms", (self.setting * 1e6).round() / 1e3)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Quoted;
    use super::*;
    use crate::solve::Stats;

    fn rung(method: &'static str, setting: f64, wall_s: f64, error: f64) -> Rung {
        Rung {
            method,
            setting,
            adaptive: true,
            wall_s,
            cpu_s: wall_s,
            stats: Stats::default(),
            error_roll_rad: error,
            error_z_m: error,
            error_normal_n: error,
            error_other: 0.0,
            other_part: 0.0,
            quoted: Quoted::default(),
            unexplained: None,
            failed: (error == f64::INFINITY).then(|| "no".into()),
        }
    }

    fn shelf() -> Study {
        let mut study = Study {
            scene: "shelf".into(),
            estimated_error_rad: 1e-8,
            estimated_error_m: 1e-8,
            estimated_error_other: 1e-8,
            others_move: true,
            duration_s: 1.0,
            judged_s: 1.0,
            parted: false,
            judge: Judge::Roll,
            quoted: Quoted::default(),
            runs: vec![
                rung("a", 1e-1, 1e-3, 1e-2),
                rung("a", 1e-2, 2e-3, 1e-4),
                rung("a", 1e-3, 4e-3, 1e-6),
                rung("lucky", 1e-1, 1e-4, 1e-5),
                rung("lucky", 1e-2, 3e-3, 1e-1),
                rung("b", 1e-1, 8e-3, 1e-9),
                rung("b", 1e-2, 9e-3, 1e-10),
                rung("c", 1e-1, 1e-5, f64::INFINITY),
            ],
            front: Vec::new(),
        };
        study.front = study.pareto();
        study
    }

    #[test]
    fn the_front_holds_what_nothing_beats_and_no_failure_or_unknowable_gain() {
        assert_eq!(shelf().front, [3, 2, 5]);
    }

    #[test]
    fn what_is_right_by_luck_is_not_recommended() {
        let study = shelf();
        assert_eq!(study.cheapest(1e-3).map(|r| r.cpu_s), Some(2e-3));
        assert_eq!(study.cheapest(1e-7).map(|r| r.method), Some("b"));
        assert!(
            study.cheapest(1e-9).is_none(),
            "finer than the references know"
        );
    }

    #[test]
    fn a_wrong_yaw_is_not_recommended_and_where_nothing_moves_nothing_is() {
        let mut study = shelf();
        (study.runs[1].error_other, study.runs[1].other_part) = (0.1, 0.4);
        assert_eq!(study.cheapest(1e-3).map(|r| r.cpu_s), Some(4e-3));
        // All quote the same roll: the cheapest by far is wrong elsewhere.
        for r in &mut study.runs[3..] {
            r.other_part = 0.4;
        }
        let said = study.sentence();
        assert!(said.contains("cheapest is a at tolerance 1e-3"), "{said}");
        study.judge = Judge::Other;
        assert!(study.sentence().contains("cheapest is a at tolerance 1e-3"));
        study.judge = Judge::Nothing;
        assert!(study.cheapest(1.0).is_none() && study.pareto().is_empty());
        assert!(study.sentence().contains("nothing moves"));
    }

    #[test]
    fn a_digit_costs_what_the_slope_of_the_front_says() {
        let mut study = shelf();
        // 1e-2 for 1 ms, 1e-4 for 2 ms, 1e-6 for 4 ms: a factor of 2 for two digits.
        study.runs.truncate(3);
        study.front = study.pareto();
        assert!((study.cost_of_a_digit().unwrap() - 2f64.sqrt()).abs() < 1e-12);
    }
}
