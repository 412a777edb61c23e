//! `cargo xtask docs`: the arm's model in the ROS packages, from the crate `arm-model`: URDF, and the meshes of links as STL.

use arm_model::{Body, Mesh};

use crate::generated::GeneratedFile;
use crate::run::TaskResult;

/// The links with a mesh, each with the body of this mesh. The files have the names of the links, as in the description that the
/// node publishes.
const MESHES: [(&str, Body); 9] = [
    ("base_link", Body::Base),
    ("turret", Body::Turret),
    ("rear_arm", Body::RearArm),
    ("forearm", Body::Forearm),
    ("wrist", Body::Wrist),
    ("hand", Body::Hand),
    ("disc", Body::Disc),
    ("finger_link", Body::Finger),
    ("opposite_finger_link", Body::OppositeFinger),
];

const FOLDER: &str = "ros/sevenbot_ros/sevenbot_ros/model";

/// The description and the meshes.
pub(crate) fn files() -> TaskResult<Vec<GeneratedFile>> {
    let meshes = MESHES.into_iter().map(|(link, body)| (format!("{FOLDER}/{link}.stl"), stl(&body.mesh())));
    let urdf = (format!("{FOLDER}/7bot_v2.urdf"), arm_model::urdf()?.into_bytes());
    Ok(meshes.chain([urdf]).collect())
}

/// Binary STL in millimetres: a header of 80 bytes, the number of triangles, and 50 bytes for each. The normals are 0, which
/// means that readers compute them.
fn stl(mesh: &Mesh) -> Vec<u8> {
    let triangles: Vec<_> = mesh.positions.chunks_exact(3).collect();
    let mut bytes = vec![b' '; 80];
    bytes.extend(u32::try_from(triangles.len()).unwrap_or(u32::MAX).to_le_bytes());
    for corners in triangles {
        bytes.extend([0; 12]);
        let coordinates = corners.iter().flatten();
        bytes.extend(coordinates.flat_map(|&coordinate| rounded(coordinate).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

/// Rounds to micrometres, because the last digits of a sine depend on the platform. Adding 0 turns -0 into 0.
fn rounded(millimetres: f32) -> f32 {
    (millimetres * 1000.0).round() / 1000.0 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_has_its_triangles_in_the_file() {
        let mesh = Body::Hand.mesh();
        let bytes = stl(&mesh);
        let triangles = mesh.positions.len() / 3;
        assert_eq!(bytes.len(), 84 + 50 * triangles);
        let first = f32::from_le_bytes(bytes[96..100].try_into().unwrap());
        assert!((first - mesh.positions[0][0]).abs() < 0.001);
    }
}
