//! Every pair's coefficients against the conditions of its order, one for each rooted tree: Σ b_i Φ_i(t) = 1/γ(t).
//!
//! Source: Butcher, Math. Comp. 26 (1972), 79; Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I (1993), II.2 and II.6.

use super::super::{dop853::Dop853, dopri5::Dopri5, fehlberg8::Fehlberg8};
use super::{MOST_ROWS, MOST_STAGES, Pair, Plain, TILE, row, time};

/// A rooted tree: what hangs from its root, in order.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Tree(Vec<Tree>);

impl Tree {
    fn nodes(&self) -> usize {
        1 + self.0.iter().map(Self::nodes).sum::<usize>()
    }

    /// γ
    fn density(&self) -> f64 {
        self.nodes() as f64 * self.0.iter().map(Self::density).product::<f64>()
    }

    /// Φ_i of every stage of `P`, the slope at the end and the dense stages included.
    fn stages<P: Pair>(&self) -> [f64; MOST_STAGES] {
        let mut all = [1.0; MOST_STAGES];
        for branch in &self.0 {
            let inner = branch.stages::<P>();
            for (stage, weight) in all.iter_mut().enumerate() {
                *weight *= row::<P>(stage)
                    .iter()
                    .map(|&(j, a)| a * inner[j])
                    .sum::<f64>();
            }
        }
        all
    }

    /// Σ w_i Φ_i
    fn weighed<P: Pair>(&self, weights: &[f64; MOST_STAGES]) -> f64 {
        let terms = weights.iter().zip(self.stages::<P>());
        terms.map(|(w, stage)| w * stage).sum()
    }
}

/// All trees of so many nodes.
fn trees(nodes: usize) -> Vec<Tree> {
    /// Puts all ways to hang trees of `left` nodes, none before `from`, beside those in `hung` into `out`.
    fn hang(left: usize, from: Option<&Tree>, hung: &mut Vec<Tree>, out: &mut Vec<Tree>) {
        if left == 0 {
            out.push(Tree(hung.clone()));
        }
        for tree in (1..=left).flat_map(trees) {
            if from.is_none_or(|from| *from <= tree) {
                hung.push(tree.clone());
                hang(left - tree.nodes(), Some(&tree), hung, out);
                hung.pop();
            }
        }
    }
    let mut out = Vec::new();
    hang(nodes - 1, None, &mut Vec::new(), &mut out);
    out
}

/// What each stage weighs in something that is linear in the slopes.
fn weights<P: Pair>(of: impl Fn(&super::Slopes, f64) -> f64) -> [f64; MOST_STAGES] {
    std::array::from_fn(|stage| {
        let mut slopes = [[0.0; TILE]; MOST_STAGES];
        slopes[stage][0] = 1.0;
        let end = P::B.iter().find(|b| b.0 == stage).map_or(0.0, |b| b.1);
        of(&slopes, end)
    })
}

/// Holds `P` to its order, that of its dense polynomial, and those of its two error estimates, which must fail beyond it.
fn hold<P: Pair>(order: usize, dense_order: usize, error_orders: [Option<usize>; 2]) {
    for stage in 1..=P::STAGES + P::DENSE_STAGES {
        let sum: f64 = row::<P>(stage).iter().map(|a| a.1).sum();
        let off = sum - time::<P>(stage);
        assert!(
            off.abs() < 1e-13,
            "{}: c of stage {stage}: {off:e}",
            P::NAME
        );
    }
    let at = |theta: f64| {
        weights::<P>(|slopes, end| {
            let (mut y1, mut rows) = ([0.0; TILE], [[0.0; TILE]; MOST_ROWS]);
            y1[0] = end;
            P::dense::<Plain>(1.0, &[0.0; TILE], &y1, slopes, &mut rows);
            P::interpolate::<Plain>(theta, &[0.0; TILE], &rows)[0]
        })
    };
    let worst = |nodes: usize, weights: &[f64; MOST_STAGES], scale: f64| {
        let off = |tree: &Tree| (tree.weighed::<P>(weights) - scale / tree.density()).abs();
        trees(nodes).iter().map(off).fold(0.0, f64::max)
    };
    // Rounded coefficients of up to fifty, in products.
    const ROUNDING: f64 = 1e-12;
    let end = weights::<P>(|_, end| end);
    for nodes in 1..=order {
        let off = worst(nodes, &end, 1.0);
        assert!(off < ROUNDING, "{}: order {nodes}: {off:e}", P::NAME);
    }
    assert!(worst(order + 1, &end, 1.0) > 1e-6, "{}", P::NAME);
    for theta in [0.1, 0.5, 0.8] {
        let between = at(theta);
        for nodes in 1..=dense_order {
            let off = worst(nodes, &between, theta.powi(nodes as i32));
            assert!(off < ROUNDING, "{} at {theta}: {nodes}: {off:e}", P::NAME);
        }
        let beyond = worst(
            dense_order + 1,
            &between,
            theta.powi(dense_order as i32 + 1),
        );
        assert!(beyond > 1e-7, "{} at {theta}: {beyond:e}", P::NAME);
    }
    for (which, order) in error_orders.into_iter().enumerate() {
        let estimate = weights::<P>(|slopes, _| P::errors::<Plain>(slopes)[which][0]);
        let Some(order) = order else {
            assert_eq!(estimate, [0.0; MOST_STAGES], "{}", P::NAME);
            continue;
        };
        for nodes in 1..=order {
            let off = worst(nodes, &estimate, 0.0);
            assert!(
                off < ROUNDING,
                "{}: error {which}, {nodes}: {off:e}",
                P::NAME
            );
        }
        assert!(worst(order + 1, &estimate, 0.0) > 1e-6, "{}", P::NAME);
    }
}

#[test]
fn there_are_as_many_trees_as_cayley_counted() {
    let counted: Vec<usize> = (1..=9).map(|nodes| trees(nodes).len()).collect();
    assert_eq!(counted, [1, 1, 2, 4, 9, 20, 48, 115, 286]);
}

#[test]
fn coefficients_meet_the_conditions_of_their_order() {
    hold::<Dopri5>(5, 4, [Some(4), None]);
    hold::<Dop853>(8, 7, [Some(5), Some(3)]);
    hold::<Fehlberg8>(8, 3, [Some(5), Some(5)]);
}
