//! The node hierarchy: which scene is shown, and where each of its nodes stands in the world.
//!
//! The walk keeps its own stack and visits no node twice, so that neither depth nor a cycle in a file can hurt it.

use super::error::{GltfError, get};
use crate::error::Warning;
use crate::scene_file::numbers::MAX_LENGTH;
use ::gltf::json::Root;
use ::gltf::json::scene::{Node, Scene};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Vec3};

/// Shortest quaternion that is taken for a rotation; f32 input says nothing about the direction of a shorter one.
pub(super) const MIN_ROTATION: f64 = 1e-6;

/// A node and its place in the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed<'a> {
    pub(super) index: usize,
    pub(super) node: &'a Node,
    /// Where its parent stands in the list that [`walk`] returns; `None` for a root of the scene.
    pub(super) parent: Option<usize>,
    /// In f64: a product of many f32 transforms keeps the precision of its factors.
    pub(super) world: DAffine3,
}

impl Placed<'_> {
    /// JSON pointer to the node.
    pub(super) fn pointer(&self) -> String {
        pointer(self.index)
    }

    /// An error about this node.
    pub(super) fn fault(&self, problem: &'static str) -> GltfError {
        fault(self.index, self.node, problem)
    }

    /// Fails where the transform flattens space: nothing can be drawn, lit or looked at through it.
    pub(super) fn check_invertible(&self) -> Result<(), GltfError> {
        if is_invertible(&self.world.matrix3) {
            return Ok(());
        }
        Err(self.fault(
            "has a singular transform, for example a scale of 0; give every axis a scale other than 0, or remove the node",
        ))
    }

    /// Position of the node's origin, in metres.
    pub(super) fn position(&self) -> Result<Vec3, GltfError> {
        let p = self.world.translation.as_vec3();
        match p.abs().max_element() <= MAX_LENGTH {
            true => Ok(p),
            false => Err(self.fault("stands more than 1e12 m from the origin")),
        }
    }

    /// Unit direction of the node's −z axis, along which lights and cameras look.
    pub(super) fn forward(&self) -> Result<DVec3, GltfError> {
        self.check_invertible()?;
        Ok(-self.world.matrix3.z_axis.normalize())
    }
}

/// Whether the transform keeps space from being flattened; its scale does not matter.
pub(super) fn is_invertible(m: &DMat3) -> bool {
    let lengths = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    // The determinant of unit columns; products of f64 err by some 1e-16.
    (m.determinant() / lengths).abs() > 1e-12
}

/// A transform as the glTF's translation, rotation and scale, applied in the opposite order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Trs {
    pub(super) translation: DVec3,
    /// Of unit length.
    pub(super) rotation: DQuat,
    pub(super) scale: DVec3,
}

impl Trs {
    pub(super) fn transform(&self) -> DAffine3 {
        DAffine3 {
            matrix3: DMat3::from_quat(self.rotation) * DMat3::from_diagonal(self.scale),
            translation: self.translation,
        }
    }
}

/// All nodes of the scene called `name`, or of the default scene, or of the first; parents come before children.
pub(super) fn walk<'a>(
    json: &'a Root,
    name: Option<&str>,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Placed<'a>>, GltfError> {
    let (scene_index, scene) = choose_scene(json, name)?;
    let mut visited = vec![false; json.nodes.len()];
    let mut placed = Vec::new();
    let mut stack: Vec<_> = (0..scene.nodes.len())
        .rev()
        .map(|i| {
            let at = format!("/scenes/{scene_index}/nodes/{i}");
            (scene.nodes[i], None, DAffine3::IDENTITY, at)
        })
        .collect();
    while let Some((node_index, parent, world_from_parent, at)) = stack.pop() {
        let index = node_index.value();
        let node = get(&json.nodes, index, "nodes", || at.clone())?;
        if std::mem::replace(&mut visited[index], true) {
            return Err(GltfError::Node {
                node: label(index, node),
                problem: "is reached twice; nodes must form a tree, in which each has one parent and none is its own ancestor",
                pointer: at,
            });
        }
        let world = world_from_parent * local_transform(index, node, warnings)?;
        let position = placed.len();
        placed.push(Placed {
            index,
            node,
            parent,
            world,
        });
        let children = node.children.as_deref().unwrap_or_default();
        for (i, &child) in children.iter().enumerate().rev() {
            stack.push((
                child,
                Some(position),
                world,
                format!("/nodes/{index}/children/{i}"),
            ));
        }
    }
    Ok(placed)
}

fn choose_scene<'a>(json: &'a Root, name: Option<&str>) -> Result<(usize, &'a Scene), GltfError> {
    if let Some(name) = name {
        let mut scenes = json.scenes.iter().enumerate();
        let found = scenes.find(|(_, scene)| scene.name.as_deref() == Some(name));
        return found.ok_or_else(|| {
            let names: Vec<_> = json.scenes.iter().filter_map(|s| s.name.clone()).collect();
            GltfError::NoScene {
                problem: format!("there is no scene called {name:?}, only {names:?}"),
                pointer: "/scenes",
            }
        });
    }
    if json.scenes.is_empty() {
        return Err(GltfError::NoScene {
            problem: "the file has no scene".into(),
            pointer: "/scenes",
        });
    }
    let index = json.scene.map_or(0, |scene| scene.value());
    let scene = get(&json.scenes, index, "scenes", || "/scene".into())?;
    Ok((index, scene))
}

/// The transform a node applies to its children.
pub(super) fn local_transform(
    index: usize,
    node: &Node,
    warnings: &mut Vec<Warning>,
) -> Result<DAffine3, GltfError> {
    if let Some(matrix) = node.matrix {
        let m = DMat4::from_cols_array(&matrix.map(f64::from));
        if !m.is_finite() {
            return Err(fault(index, node, "has a matrix that is not finite"));
        }
        if m.row(3) != glam::DVec4::W {
            return Err(fault(
                index,
                node,
                "has a matrix with a last row other than 0 0 0 1; only affine transforms are allowed",
            ));
        }
        return Ok(DAffine3::from_mat4(m));
    }
    trs(index, node, warnings).map(|trs| trs.transform())
}

/// Translation, rotation and scale of a node that has no matrix.
pub(super) fn trs(
    index: usize,
    node: &Node,
    warnings: &mut Vec<Warning>,
) -> Result<Trs, GltfError> {
    let vector = |v: Option<[f32; 3]>, default| v.map_or(default, |v| Vec3::from(v).as_dvec3());
    let translation = vector(node.translation, DVec3::ZERO);
    let scale = vector(node.scale, DVec3::ONE);
    let quaternion = node.rotation.unwrap_or_default().0.map(f64::from);
    let rotation = DQuat::from_array(quaternion);
    if !translation.is_finite() || !scale.is_finite() || !rotation.is_finite() {
        let problem = "has a translation, rotation or scale that is not finite";
        return Err(fault(index, node, problem));
    }
    let length = rotation.length();
    if length < MIN_ROTATION {
        let problem = "has a rotation of length 0; a unit quaternion is needed";
        return Err(fault(index, node, problem));
    }
    // Quaternions stored as normalised bytes miss the unit length by up to 1/127.
    if (length - 1.0).abs() > 0.01 {
        warnings.push(Warning::Gltf {
            problem: format!(
                "the rotation of node \"{}\" has length {length:.3} and is normalised",
                label(index, node)
            ),
            pointer: pointer(index),
        });
    }
    Ok(Trs {
        translation,
        rotation: rotation / length,
        scale,
    })
}

/// Name of a node for messages: the file's, or its number.
pub(super) fn label(index: usize, node: &Node) -> String {
    node.name.clone().unwrap_or_else(|| index.to_string())
}

fn pointer(index: usize) -> String {
    format!("/nodes/{index}")
}

fn fault(index: usize, node: &Node, problem: &'static str) -> GltfError {
    GltfError::Node {
        node: label(index, node),
        problem,
        pointer: pointer(index),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    fn root(nodes: &str) -> Root {
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{nodes}]}}"#
        );
        Root::from_slice(text.as_bytes()).unwrap()
    }

    fn outcome(nodes: &str) -> String {
        let mut warnings = Vec::new();
        let json = root(nodes);
        let placed = walk(&json, None, &mut warnings).and_then(|placed| {
            placed.iter().try_for_each(Placed::check_invertible)?;
            Ok(placed.len())
        });
        match (placed, warnings.first()) {
            (Err(error), _) => error.to_string(),
            (Ok(_), Some(warning)) => warning.to_string(),
            (Ok(n), None) => format!("{n} nodes"),
        }
    }

    #[test]
    fn transforms_of_parents_apply_after_those_of_children() {
        // A quarter turn about y after scaling: x becomes −z, and the child moves along the turned, scaled x.
        let json = root(
            r#"{"children":[1],"translation":[1,2,3],"rotation":[0,0.70710678,0,0.70710678],"scale":[2,2,2]},
               {"translation":[5,0,0]}"#,
        );
        let placed = walk(&json, None, &mut Vec::new()).unwrap();
        let p = placed[1].world.translation;
        assert!((p - DVec3::new(1.0, 2.0, -7.0)).length() < 1e-6, "{p}");
    }

    #[test]
    fn broken_hierarchies_and_transforms_name_the_node() {
        for (nodes, part) in [
            (r#"{"children":[0]}"#, "reached twice"),
            (
                r#"{"name":"a","children":[1]},{"children":[0]}"#,
                "node \"a\" is reached twice",
            ),
            (r#"{"children":[1,1]},{}"#, "/nodes/0/children/1"),
            (
                r#"{"children":[7]}"#,
                "index 7 is out of range: the file has 1 nodes (at /nodes/0/children/0)",
            ),
            (r#"{"rotation":[0,0,0,0]}"#, "rotation of length 0"),
            (
                r#"{"rotation":[0,0,0,2]}"#,
                "has length 2.000 and is normalised (at /nodes/0)",
            ),
            (
                r#"{"scale":[1,0,1],"name":"flat"}"#,
                "node \"flat\" has a singular transform",
            ),
            (r#"{"scale":[1e-15,1e-15,1e-15]}"#, "1 nodes"),
            (r#"{"translation":[1e39,0,0]}"#, "not finite"),
            (
                r#"{"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,1e39,0,0,1]}"#,
                "matrix that is not finite",
            ),
            (
                r#"{"matrix":[1,0,0,1,0,1,0,0,0,0,1,0,0,0,0,1]}"#,
                "last row",
            ),
        ] {
            let found = outcome(nodes);
            assert!(found.contains(part), "{nodes}: {found}");
        }
    }

    #[test]
    fn a_chain_of_a_hundred_thousand_nodes_is_walked_on_a_small_stack() {
        const DEPTH: usize = 100_000;
        let mut nodes: Vec<_> = (1..DEPTH)
            .map(|i| format!(r#"{{"children":[{i}],"translation":[1,0,0]}}"#))
            .collect();
        nodes.push("{}".into());
        let json = root(&nodes.join(","));
        let walked = std::thread::Builder::new()
            .stack_size(256 * 1024)
            .spawn(move || {
                let placed = walk(&json, None, &mut Vec::new()).unwrap();
                placed.last().unwrap().world.translation.x
            })
            .unwrap()
            .join()
            .unwrap();
        assert_eq!(walked, (DEPTH - 1) as f64);
    }
}
