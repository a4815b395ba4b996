//! From axes to points: the product of the axes that have values, times the sample of the others.

use super::sobol::Sobol;
use super::spec::{Design, DesignKind, Spec};
use sim::random::{Stream, uniform_pair};

/// The points of a study. Any of them is worked out when it is asked for.
pub struct Points {
    spec: Spec,
    sample: Sample,
    grid: u64,
}

enum Sample {
    None,
    Latin(Vec<Vec<u32>>, u64),
    Sobol(Sobol),
    Sensitivity(Sobol, u32),
}

impl Points {
    /// The points of a checked study.
    pub fn new(spec: &Spec) -> Result<Self, String> {
        let sampled = spec.axes.iter().filter(|a| a.is_sampled()).count();
        let sample = match &spec.design {
            None => Sample::None,
            Some(d) => match d.kind {
                DesignKind::LatinHypercube => {
                    Sample::Latin((0..sampled).map(|axis| shuffled(d, axis)).collect(), d.seed)
                }
                DesignKind::Sobol => Sample::Sobol(Sobol::new(sampled)),
                // Past the origin, where both halves of the coordinates are equal, by a power of two: balanced again.
                DesignKind::Sensitivity => Sample::Sensitivity(
                    Sobol::new(2 * sampled),
                    (d.points as u32).next_power_of_two(),
                ),
            },
        };
        let own = spec.axes.iter().filter(|a| !a.is_sampled());
        let grid = own
            .map(|a| a.len())
            .try_fold(1u64, u64::checked_mul)
            .ok_or("the axes have more points than can be counted")?;
        let points = Self {
            spec: spec.clone(),
            sample,
            grid,
        };
        let all = points
            .grid
            .checked_mul(points.sample_len())
            .and_then(|n| n.checked_mul(spec.seeds));
        if all.is_none_or(|n| n > MOST_RUNS) {
            return Err(format!("the study has more than {MOST_RUNS} runs"));
        }
        Ok(points)
    }

    fn sample_len(&self) -> u64 {
        let points = self.spec.design.as_ref().map_or(1, |d| d.points);
        match &self.sample {
            Sample::Sensitivity(..) => points * (self.spec.axes.len() as u64 + 2),
            _ => points,
        }
    }

    /// How many there are.
    pub fn len(&self) -> u64 {
        self.grid * self.sample_len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The values of point `index`, one for each axis. The last axis with values of its own runs fastest but for the sample.
    pub fn values(&self, index: u64) -> Vec<toml::Value> {
        let (mut grid, sample) = (index / self.sample_len(), index % self.sample_len());
        let mut values: Vec<toml::Value> = Vec::with_capacity(self.spec.axes.len());
        let mut dimension = self.spec.axes.iter().filter(|a| a.is_sampled()).count();
        for axis in self.spec.axes.iter().rev() {
            if axis.is_sampled() {
                dimension -= 1;
                values.push(axis.at(self.share(sample, dimension)).into());
            } else {
                values.push(axis.value(grid % axis.len()));
                grid /= axis.len();
            }
        }
        values.reverse();
        values
    }

    /// Coordinate of a sample's point, 0 … 1.
    fn share(&self, sample: u64, dimension: usize) -> f64 {
        // OK because a checked design has at most 2^30 points.
        let n = sample as u32;
        match &self.sample {
            Sample::None => 0.0,
            Sample::Latin(slices, seed) => {
                let slice = slices[dimension][n as usize];
                let [u, _] = uniform_pair(*seed, Stream::Design, dimension as u32, sample);
                // 1 − u: from [0, 1).
                (f64::from(slice) + 1.0 - u) / slices[dimension].len() as f64
            }
            Sample::Sobol(sobol) => sobol.at(n, dimension),
            Sample::Sensitivity(sobol, skip) => {
                let axes = self.spec.axes.len();
                let (base, row) = (sample / (axes as u64 + 2), sample % (axes as u64 + 2));
                // Rows A, AB_1 … AB_d, B: AB_i is A with coordinate i of B.
                let from_b = row == axes as u64 + 1 || row == dimension as u64 + 1;
                let dimension = if from_b { dimension + axes } else { dimension };
                sobol.at(base as u32 + skip, dimension)
            }
        }
    }
}

/// Beyond this a slip of the keyboard is likelier than a wish.
const MOST_RUNS: u64 = 1_000_000_000;

/// 0 … points − 1 in an order drawn from the seed (Fisher and Yates).
fn shuffled(design: &Design, axis: usize) -> Vec<u32> {
    let mut order: Vec<u32> = (0..design.points as u32).collect();
    for i in (1..order.len()).rev() {
        let index = (1 << 40) + i as u64;
        let [u, _] = uniform_pair(design.seed, Stream::Design, axis as u32, index);
        order.swap(i, ((1.0 - u) * (i + 1) as f64) as usize);
    }
    order
}

#[cfg(test)]
mod tests {
    use super::super::spec::{number, parse};
    use super::*;

    fn points(text: &str) -> Points {
        Points::new(&parse("test", &format!("scene = \"music\"\n{text}")).unwrap()).unwrap()
    }

    fn all(points: &Points) -> Vec<Vec<f64>> {
        (0..points.len())
            .map(|k| {
                points
                    .values(k)
                    .iter()
                    .map(|v| number(v).unwrap())
                    .collect()
            })
            .collect()
    }

    #[test]
    fn a_grid_is_the_product_of_its_axes() {
        let p = points(
            "axes = [{ key = \"a\", values = [1, 2] }, { key = \"b\", from = 1.0, to = 100.0, count = 3, spacing = \"log\" }]",
        );
        let expected = [
            [1.0, 1.0],
            [1.0, 10.0],
            [1.0, 100.0],
            [2.0, 1.0],
            [2.0, 10.0],
            [2.0, 100.0],
        ];
        for (found, expected) in all(&p).iter().zip(expected) {
            for (f, e) in found.iter().zip(expected) {
                assert!((f / e - 1.0).abs() < 1e-15, "{found:?}");
            }
        }
        assert_eq!(p.len(), 6);
        assert_eq!(points("").len(), 1);
    }

    #[test]
    fn a_latin_hypercube_has_one_point_in_every_slice() {
        let axes = "axes = [{ key = \"a\", from = 0, to = 1 }, { key = \"b\", from = 0, to = 1 }]";
        let p = points(&format!(
            "{axes}\ndesign = {{ kind = \"latin-hypercube\", points = 50, seed = 3 }}"
        ));
        let all = all(&p);
        for axis in 0..2 {
            let mut slices: Vec<u64> = all.iter().map(|x| (x[axis] * 50.0) as u64).collect();
            slices.sort_unstable();
            assert_eq!(slices, (0..50).collect::<Vec<_>>());
        }
        let mean = all.iter().map(|x| (x[0] - 0.5) * (x[1] - 0.5)).sum::<f64>() / 50.0;
        // Four standard errors of 1/12/√50.
        assert!(
            mean.abs() < 4.0 / 12.0 / 50f64.sqrt(),
            "axes are tied: {mean}"
        );
    }

    #[test]
    fn sobol_points_cross_a_grid() {
        let p = points(
            "axes = [{ key = \"a\", values = [7, 8] }, { key = \"b\", from = 10, to = 20 }]\ndesign = { kind = \"sobol\", points = 4 }",
        );
        assert_eq!(
            all(&p),
            [
                [7.0, 10.0],
                [7.0, 15.0],
                [7.0, 17.5],
                [7.0, 12.5],
                [8.0, 10.0],
                [8.0, 15.0],
                [8.0, 17.5],
                [8.0, 12.5]
            ]
        );
    }

    /// Two seeds that give the same points would look like a study without a scatter.
    #[test]
    fn a_seed_that_draws_nothing_is_refused() {
        let with = |kind: &str| {
            let axes = "axes = [{ key = \"a\", from = 0, to = 1 }]";
            let design = format!("design = {{ kind = \"{kind}\", points = 8, seed = 3 }}");
            parse("test", &format!("scene = \"music\"\n{axes}\n{design}"))
        };
        for kind in ["sobol", "sensitivity"] {
            let problem = with(kind).unwrap_err();
            assert!(problem.contains("first_seed"), "{problem}");
        }
        assert!(with("latin-hypercube").is_ok());
    }

    #[test]
    fn sensitivity_swaps_one_coordinate_at_a_time() {
        let p = points(
            "axes = [{ key = \"a\", from = 0, to = 1 }, { key = \"b\", from = 0, to = 1 }]\ndesign = { kind = \"sensitivity\", points = 8 }",
        );
        let all = all(&p);
        assert_eq!(all.len(), 32);
        for rows in all.chunks(4) {
            let (a, b) = (&rows[0], &rows[3]);
            assert_eq!(rows[1], [b[0], a[1]]);
            assert_eq!(rows[2], [a[0], b[1]]);
            assert!(a != b);
        }
    }
}
