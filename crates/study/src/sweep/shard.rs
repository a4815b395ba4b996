//! Which part of a study one of several tasks computes.

use std::ops::Range;

/// Task `index` of `count`, the first being 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which.
    pub index: u64,
    /// Of how many.
    pub count: u64,
}

/// What a scheduler tells its tasks, by environment variable.
struct Scheduler {
    index: &'static str,
    /// Number of the first task: another variable's, or this number; `None` where whoever submits chooses it and nobody tells.
    first: Option<(&'static str, u64)>,
    /// How many there are; `None` where the scheduler does not say.
    count: Option<&'static str>,
}

/// Slurm, AWS Batch, PBS, Kubernetes.
const SCHEDULERS: &[Scheduler] = &[
    Scheduler {
        index: "SLURM_ARRAY_TASK_ID",
        first: Some(("SLURM_ARRAY_TASK_MIN", 0)),
        count: Some("SLURM_ARRAY_TASK_COUNT"),
    },
    Scheduler {
        index: "AWS_BATCH_JOB_ARRAY_INDEX",
        first: Some(("", 0)),
        count: Some("AWS_BATCH_JOB_ARRAY_SIZE"),
    },
    Scheduler {
        index: "PBS_ARRAY_INDEX",
        first: None,
        count: None,
    },
    Scheduler {
        index: "JOB_COMPLETION_INDEX",
        first: Some(("", 0)),
        count: None,
    },
];

impl Shard {
    /// Everything.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// `K/N`, 1/8 being the first of eight.
    ///
    /// # Errors
    /// What was expected.
    pub fn parse(text: &str) -> Result<Self, String> {
        let wrong = || format!("found `{text}`, expected K/N with K from 1 to N, for example 3/8");
        let (k, n) = text.split_once('/').ok_or_else(wrong)?;
        let (k, n): (u64, u64) = (
            k.trim().parse().map_err(|_| wrong())?,
            n.trim().parse().map_err(|_| wrong())?,
        );
        if (1..=n).contains(&k) {
            Ok(Self {
                index: k - 1,
                count: n,
            })
        } else {
            Err(wrong())
        }
    }

    /// What a scheduler says, and by which variable; `shards` is the number of tasks where it does not say that.
    ///
    /// # Errors
    /// A variable that is no number, or a number of tasks that nobody gave.
    pub fn of_environment(
        shards: Option<u64>,
        get: impl Fn(&str) -> Option<String>,
    ) -> Result<Option<(Self, &'static str)>, String> {
        for s in SCHEDULERS {
            let Some(index) = get(s.index).filter(|v| !v.is_empty()) else {
                continue;
            };
            let number = |name: &str, text: &str| {
                text.parse::<u64>()
                    .map_err(|_| format!("{name} is `{text}`, expected a whole number"))
            };
            let index = number(s.index, &index)?;
            let Some((first, usual)) = s.first else {
                return Err(format!(
                    "{0} says which task this is, but neither of how many nor where they count from: submit tasks 1 to N and give --shard \"${0}/N\"",
                    s.index
                ));
            };
            let first = match get(first) {
                Some(text) => number(first, &text)?,
                None => usual,
            };
            let told = s.count.and_then(|name| Some((name, get(name)?)));
            let told = told
                .map(|(name, text)| Ok::<_, String>((name, number(name, &text)?)))
                .transpose()?;
            let count = match (shards, told) {
                (Some(n), Some((name, count))) if n != count => {
                    return Err(format!(
                        "--shards is {n}, but {name} is {count}: which of {n} a task is, a part of them does not tell; give --shard K/{n}"
                    ));
                }
                (Some(n), _) => n,
                (None, Some((_, count))) => count,
                (None, None) => {
                    return Err(format!(
                        "{} says which task this is, but not of how many: give --shards N",
                        s.index
                    ));
                }
            };
            let index = index
                .checked_sub(first)
                .filter(|k| *k < count)
                .ok_or_else(|| {
                    format!(
                        "{} is {index}, which is not one of {count} tasks from {first} on",
                        s.index
                    )
                })?;
            return Ok(Some((Self { index, count }, s.index)));
        }
        match shards {
            Some(n) => Err(format!(
                "--shards {n} says of how many tasks this is one, but no scheduler says which: give --shard K/{n}"
            )),
            None => Ok(None),
        }
    }

    /// Its share of `blocks`: neighbours, as equal as whole blocks can be.
    pub fn of(self, blocks: u64) -> Range<u64> {
        let cut = |k: u64| (u128::from(blocks) * u128::from(k) / u128::from(self.count)) as u64;
        cut(self.index)..cut(self.index + 1)
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.index + 1, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_cover_everything_once() {
        for (blocks, count) in [(125, 8), (3, 8), (1, 1), (256, 255)] {
            let mut next = 0;
            for index in 0..count {
                let range = Shard { index, count }.of(blocks);
                assert_eq!(range.start, next);
                next = range.end;
            }
            assert_eq!(next, blocks);
        }
    }

    #[test]
    fn words_become_shards() {
        assert_eq!(Shard::parse("3/8"), Ok(Shard { index: 2, count: 8 }));
        for wrong in ["0/8", "9/8", "3", "a/b", "1/0", "-1/2"] {
            assert!(Shard::parse(wrong).unwrap_err().contains("3/8"), "{wrong}");
        }
    }

    #[test]
    fn schedulers_are_asked() {
        let slurm = |name: &str| match name {
            "SLURM_ARRAY_TASK_ID" => Some("12".into()),
            "SLURM_ARRAY_TASK_MIN" => Some("10".into()),
            "SLURM_ARRAY_TASK_COUNT" => Some("4".into()),
            _ => None,
        };
        let found = Shard::of_environment(Some(4), slurm).unwrap().unwrap();
        assert_eq!(found.0, Shard { index: 2, count: 4 });
        let part = Shard::of_environment(Some(8), slurm).unwrap_err();
        assert!(part.contains("--shard K/8"), "{part}");
        let found = Shard::of_environment(None, slurm).unwrap().unwrap();
        assert_eq!(found, (Shard { index: 2, count: 4 }, "SLURM_ARRAY_TASK_ID"));
        let kubernetes = |name: &str| (name == "JOB_COMPLETION_INDEX").then(|| "1".into());
        assert!(
            Shard::of_environment(None, kubernetes)
                .unwrap_err()
                .contains("--shards")
        );
        assert_eq!(
            Shard::of_environment(Some(3), kubernetes)
                .unwrap()
                .unwrap()
                .0,
            Shard { index: 1, count: 3 }
        );
        assert!(Shard::of_environment(Some(1), kubernetes).is_err());
        // An array of PBS may begin at 0 or at 1, and nothing says so: taken for 0, that of tasks 1 to 8 left the first part to nobody.
        let pbs = |name: &str| (name == "PBS_ARRAY_INDEX").then(|| "1".into());
        for shards in [None, Some(8)] {
            let told = Shard::of_environment(shards, pbs).unwrap_err();
            assert!(told.contains("--shard \"$PBS_ARRAY_INDEX/N\""), "{told}");
        }
        assert_eq!(Shard::of_environment(None, |_| None), Ok(None));
        let nobody = Shard::of_environment(Some(4), |_| None).unwrap_err();
        assert!(nobody.contains("--shard K/4"), "{nobody}");
    }
}
