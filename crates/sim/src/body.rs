//! The rigid body: what is constant of it.

use crate::scene::parts::BodySpec;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// Mass properties. The inertia is about the centre of mass, in body axes.
#[derive(Clone, Debug)]
pub struct Body {
    /// kg
    pub mass_kg: f64,
    /// kg·m²
    pub inertia_kg_m2: Matrix3<f64>,
    /// 1/(kg·m²)
    pub inverse_inertia: Matrix3<f64>,
    /// Gravity in the world frame, m/s².
    pub gravity_m_per_s2: Vector3<f64>,
}

impl Body {
    /// Checks that the inertia is that of some distribution of mass, and inverts it.
    ///
    /// A tensor belongs to a rigid body exactly when its principal moments are positive and obey
    /// I₁ + I₂ ≥ I₃ (Landau & Lifshitz, Mechanics, §32). A rod's I₁ = 0 is excluded: its spin is undefined.
    ///
    /// # Errors
    /// A sentence that says which moment is impossible.
    pub fn new(spec: &BodySpec) -> Result<Self, String> {
        let i = &spec.inertia_kg_m2;
        let tensor = Matrix3::new(i.xx, i.xy, i.xz, i.xy, i.yy, i.yz, i.xz, i.yz, i.zz);
        if !tensor.iter().all(|x| x.is_finite()) {
            return Err("found a moment that is not a finite number".into());
        }
        let mut moments: Vec<f64> = SymmetricEigen::new(tensor)
            .eigenvalues
            .iter()
            .copied()
            .collect();
        moments.sort_by(f64::total_cmp);
        let [small, middle, large] = moments[..] else {
            unreachable!("three moments")
        };
        if small <= 0.0 || small < large * 1e-14 {
            return Err(format!(
                "its smallest principal moment is {small:.4e}, expected one above zero"
            ));
        }
        // The eigenvalues carry rounding of the order of ε·I₃, and a flat plate meets the bound exactly.
        if small + middle < large * (1.0 - 1e-12) {
            return Err(format!(
                "its principal moments {small:.6}, {middle:.6}, {large:.6} break the triangle inequality I1 + I2 >= I3: no body has them"
            ));
        }
        let inverse = tensor
            .try_inverse()
            .ok_or("the tensor cannot be inverted")?;
        Ok(Self {
            mass_kg: spec.mass_kg,
            inertia_kg_m2: tensor,
            inverse_inertia: inverse,
            gravity_m_per_s2: spec.gravity_m_per_s2.into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::parts::Inertia;

    fn with(inertia: Inertia) -> Result<Body, String> {
        Body::new(&BodySpec {
            inertia_kg_m2: inertia,
            ..BodySpec::default()
        })
    }

    #[test]
    fn impossible_inertias_are_refused() {
        let plain = Inertia {
            xx: 1.0,
            yy: 2.0,
            zz: 2.5,
            xy: 0.0,
            xz: 0.0,
            yz: 0.0,
        };
        assert!(with(plain).is_ok());
        assert!(
            with(Inertia { zz: 3.0, ..plain }).is_ok(),
            "a flat plate is a body"
        );
        assert!(
            with(Inertia { zz: 3.1, ..plain })
                .unwrap_err()
                .contains("triangle")
        );
        assert!(
            with(Inertia { xx: -1.0, ..plain })
                .unwrap_err()
                .contains("above zero")
        );
        assert!(
            with(Inertia { xy: 1.5, ..plain }).is_err(),
            "a product beyond its moments"
        );
    }
}
