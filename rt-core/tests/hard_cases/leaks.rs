//! Rays that slip between triangles of closed meshes.

use crate::common::{cube, sphere, torus};
use glam::DVec3;
use rt_core::accel::{BuildOptions, BuildQuality, Robustness, World};
use rt_core::glam;
use rt_core::mesh::TriMesh;
use rt_core::robustness::{Aim, LeakTest, Query, Start};

fn cases() -> Vec<(&'static str, TriMesh, Start)> {
    let far = DVec3::new(1000.0, 700.0, -1300.0);
    let ball = |center, radius| Start::Ball { center, radius };
    let near = |center| Start::NearSurface { center };
    let mid = DVec3::X;
    vec![
        ("sphere", sphere(6, 1.0, DVec3::ZERO), ball(DVec3::ZERO, 0.7)),
        ("far sphere", sphere(6, 1.0, far), ball(far, 0.7)),
        ("torus", torus(300, 100), ball(mid, 0.3)),
        ("cube", cube(24), ball(DVec3::ZERO, 0.9)),
        ("coarse cube", cube(1), ball(DVec3::ZERO, 0.9)),
        ("sphere, near", sphere(6, 1.0, DVec3::ZERO), near(DVec3::ZERO)),
        ("icosahedron, near", sphere(0, 1.0, DVec3::ZERO), near(DVec3::ZERO)),
        ("far icosahedron, near", sphere(0, 1.0, far), near(far)),
        ("cube, near", cube(24), near(DVec3::ZERO)),
        ("coarse cube, near", cube(1), near(DVec3::ZERO)),
    ]
}

#[test]
#[ignore]
fn survey() {
    let n: usize = std::env::var("LEAK_RAYS").ok().and_then(|s| s.parse().ok()).unwrap_or(1 << 18);
    for (name, mesh, start) in cases() {
        for robustness in Robustness::ALL {
            let options = BuildOptions { quality: BuildQuality::Balanced, robustness, simd: None };
            let world = World::from_mesh(mesh.clone(), &options).expect("fine");
            for aim in Aim::ALL {
                for query in Query::ALL {
                    let c = LeakTest { world: &world, mesh: &mesh, start, aim, seed: 1 }.count(query, n);
                    println!("{name:20} {:10} {:12} {query:?} {c:?}", robustness.name(), aim.name());
                }
            }
        }
    }
}
