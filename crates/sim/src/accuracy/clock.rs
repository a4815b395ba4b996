//! How long a run takes: by the wall, and on the processor.

use std::time::Instant;

/// A duration on both clocks, s.
#[derive(Clone, Copy)]
pub(super) struct Time {
    pub wall_s: f64,
    pub cpu_s: f64,
}

/// Started with a run, on the thread that runs it.
pub(super) struct Clock {
    began: Instant,
    began_cpu_s: Option<f64>,
}

/// What the processor has spent on this thread, s; unknown where no system call tells.
fn thread_cpu_s() -> Option<f64> {
    #[cfg(any(target_os = "linux", target_os = "macos", target_os = "freebsd"))]
    {
        let t = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        Some(t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64)
    }
    #[cfg(not(any(target_os = "linux", target_os = "macos", target_os = "freebsd")))]
    None
}

impl Clock {
    pub fn start() -> Self {
        Self {
            began: Instant::now(),
            began_cpu_s: thread_cpu_s(),
        }
    }

    /// On the processor; by the wall where nobody knows better.
    pub fn cpu_s(&self) -> f64 {
        match (self.began_cpu_s, thread_cpu_s()) {
            (Some(began), Some(now)) => now - began,
            _ => self.began.elapsed().as_secs_f64(),
        }
    }

    pub fn read(&self) -> Time {
        Time {
            wall_s: self.began.elapsed().as_secs_f64(),
            cpu_s: self.cpu_s(),
        }
    }
}

/// The median of each clock; of at least one time.
pub(super) fn median(times: &[Time]) -> Time {
    let middle = |of: fn(&Time) -> f64| {
        let mut all: Vec<f64> = times.iter().map(of).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    Time {
        wall_s: middle(|t| t.wall_s),
        cpu_s: middle(|t| t.cpu_s),
    }
}
