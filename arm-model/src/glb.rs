//! The arm as binary glTF: a node for each link, with a mesh if the link has a shape, in the straight pose.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io;

use gltf::binary::{Glb, Header};
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::buffer::View;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::scene::UnitQuaternion;
use gltf::json::validation::Checked::Valid;
use gltf::json::validation::USize64;
use gltf::json::{self, Accessor, Buffer, Index, Node, Root, Scene};

use crate::ABOUT;
use crate::chain::{Axes, LINKS, Link};
use crate::look::of_link;
use crate::mesh::Mesh;

/// Rotates to the axes of glTF, where y is up, z forward and x to the left: a third of a turn about the diagonal.
const FROM_Z_UP: UnitQuaternion = UnitQuaternion([-0.5, -0.5, -0.5, 0.5]);
/// Bytes of a vector of three `f32`.
const VECTOR_BYTES: usize = 12;

/// The arm as binary glTF (GLB), in the straight pose. The nodes are the links. To move a joint, turn the node of its link
/// about the axis of the joint in the URDF. With joint 2, also turn `elbow_link` back.
///
/// # Errors
/// The bytes cannot be encoded. This does not happen in practice, because they are written to memory.
///
/// ```
/// assert!(arm_model::glb()?.starts_with(b"glTF"));
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn glb() -> io::Result<Vec<u8>> {
    let mut file = File::new();
    let mut nodes: Vec<(&Link, Index<Node>)> = Vec::new();
    for link in LINKS.iter().rev() {
        let is_child = |other: &Link| other.joint.is_some_and(|joint| joint.parent == link.name);
        let children = nodes.iter().filter(|(other, _)| is_child(other)).map(|(_, node)| *node).collect();
        let node = file.node(link, children);
        nodes.push((link, node));
    }
    let base = nodes.last().map(|(_, node)| *node).into_iter().collect();
    file.scene(base);
    file.finish()
}

/// A glTF file under construction: its description, and the bytes of its meshes.
struct File {
    root: Root,
    bytes: Vec<u8>,
    buffer: Index<Buffer>,
}

impl File {
    fn new() -> Self {
        let mut root = Root::default();
        root.asset.generator = Some("sevenbot model".to_owned());
        root.asset.copyright = Some(ABOUT.join(" "));
        let buffer = root.push(Buffer {
            byte_length: USize64(0),
            name: None,
            uri: None,
            extensions: None,
            extras: json::Extras::default(),
        });
        Self { root, bytes: Vec::new(), buffer }
    }

    fn node(&mut self, link: &Link, children: Vec<Index<Node>>) -> Index<Node> {
        let mesh = of_link(link.name).map(|mesh| self.mesh(link, mesh));
        let origin = link.joint.map(|joint| joint.origin);
        self.root.push(Node {
            children: (!children.is_empty()).then_some(children),
            mesh,
            name: Some(link.name.to_owned()),
            translation: origin.map(singles),
            ..Node::default()
        })
    }

    fn mesh(&mut self, link: &Link, mut mesh: Mesh) -> Index<json::Mesh> {
        for position in &mut mesh.positions {
            *position = position.map(|millimetres| millimetres / 1000.0);
        }
        let positions = self.accessor(&mesh.positions, Some(mesh.bounds()));
        let normals = self.accessor(&mesh.normals, None);
        let attributes =
            BTreeMap::from([(Valid(Semantic::Positions), positions), (Valid(Semantic::Normals), normals)]);
        let primitive = Primitive {
            attributes,
            extensions: None,
            extras: json::Extras::default(),
            indices: None,
            material: None,
            mode: Valid(Mode::Triangles),
            targets: None,
        };
        self.root.push(json::Mesh {
            extensions: None,
            extras: json::Extras::default(),
            name: Some(link.name.to_owned()),
            primitives: vec![primitive],
            weights: None,
        })
    }

    fn accessor(&mut self, vectors: &[[f32; 3]], bounds: Option<[[f32; 3]; 2]>) -> Index<Accessor> {
        let view = self.root.push(View {
            buffer: self.buffer,
            byte_length: USize64::from(vectors.len().saturating_mul(VECTOR_BYTES)),
            byte_offset: Some(USize64::from(self.bytes.len())),
            byte_stride: None,
            name: None,
            target: None,
            extensions: None,
            extras: json::Extras::default(),
        });
        self.bytes.extend(vectors.iter().flatten().flat_map(|number| number.to_le_bytes()));
        let [min, max] =
            bounds.map_or([None, None], |bounds| bounds.map(|corner| Some(corner.to_vec().into())));
        self.root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(vectors.len()),
            component_type: Valid(GenericComponentType(ComponentType::F32)),
            extensions: None,
            extras: json::Extras::default(),
            type_: Valid(Type::Vec3),
            min,
            max,
            name: None,
            normalized: false,
            sparse: None,
        })
    }

    /// Adds the scene: the base, rotated to the axes of glTF.
    fn scene(&mut self, base: Vec<Index<Node>>) {
        let upright = self.root.push(Node {
            children: Some(base),
            name: Some("7bot_v2".to_owned()),
            rotation: Some(FROM_Z_UP),
            ..Node::default()
        });
        let scene = self.root.push(Scene {
            extensions: None,
            extras: json::Extras::default(),
            name: None,
            nodes: vec![upright],
        });
        self.root.scene = Some(scene);
    }

    fn finish(mut self) -> io::Result<Vec<u8>> {
        if let Some(buffer) = self.root.buffers.first_mut() {
            buffer.byte_length = USize64::from(self.bytes.len());
        }
        let json = json::serialize::to_vec(&self.root).map_err(io::Error::other)?;
        // The writer pads both parts and computes the length.
        let header = Header { magic: *b"glTF", version: 2, length: 0 };
        let glb = Glb { header, json: Cow::Owned(json), bin: Some(Cow::Owned(self.bytes)) };
        glb.to_vec().map_err(io::Error::other)
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest f32, which glTF demands")]
fn singles(axes: Axes) -> [f32; 3] {
    axes.map(|component| component as f32)
}
