//! The account of what acts sideways at the handles.

use super::{Book, Pair, Power, Workspace};
use crate::lanes::{Moments, Number};

/// Books the whole sideways force, whatever laws set it. It stores nothing: what it gives back counts as dissipated until then.
#[derive(Debug)]
pub(crate) struct Sideways;

impl Book for Sideways {
    #[inline(always)]
    fn power<N: Moments>(
        &self,
        _w: &Workspace<N>,
        pairs: &[Pair<N>],
        _first: usize,
    ) -> Power<N::Each> {
        let (mut work, mut absorbed) = (N::Pair::splat(0.0), N::Pair::splat(0.0));
        for p in pairs {
            for axis in 0..2 {
                work = p.tangential[axis].madd(p.base_rate[axis], work);
                absorbed = p.tangential[axis].madd(p.gap_rate[axis], absorbed);
            }
        }
        Power {
            work_w: N::sum(work),
            dissipated_w: N::sum(absorbed),
        }
    }
}
