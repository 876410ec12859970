//! What animations would move besides cameras: it stands still, and a warning says so.

use super::error::{GltfError, get};
use super::nodes::Placed;
use crate::error::Warning;
use ::gltf::json::Root;
use std::collections::BTreeMap;

/// Warns once where animations would move meshes or lights that are shown.
pub(super) fn warn(
    json: &Root,
    placed: &[Placed<'_>],
    warnings: &mut Vec<Warning>,
) -> Result<(), GltfError> {
    if json.animations.is_empty() {
        return Ok(());
    }
    let place: BTreeMap<_, _> = placed
        .iter()
        .enumerate()
        .map(|(i, node)| (node.index, i))
        .collect();
    let carries = carries(json, placed, &place);
    let mut count = 0;
    let mut first = None;
    for (i, animation) in json.animations.iter().enumerate() {
        let mut moves_something = false;
        for (j, channel) in animation.channels.iter().enumerate() {
            let node = channel.target.node.value();
            get(&json.nodes, node, "nodes", || {
                format!("/animations/{i}/channels/{j}/target/node")
            })?;
            let carries = place.get(&node).and_then(|&place| carries.get(place));
            moves_something |= carries.copied().unwrap_or(false);
        }
        if moves_something {
            count += 1;
            first = first.or(Some(i));
        }
    }
    let Some(first) = first else {
        return Ok(());
    };
    let animations = match count {
        1 => "an animation moves".to_owned(),
        n => format!("{n} animations move"),
    };
    warnings.push(Warning::Gltf {
        problem: format!(
            "{animations} surfaces or lights, which stand still here; only cameras move"
        ),
        pointer: format!("/animations/{first}"),
    });
    Ok(())
}

/// For each node, whether it or anything below it is a mesh, a light, or a joint that moves a mesh.
fn carries(json: &Root, placed: &[Placed<'_>], place: &BTreeMap<usize, usize>) -> Vec<bool> {
    let mut carries = vec![false; placed.len()];
    let mut mark = |node: usize| {
        let mut at = Some(node);
        // What is marked has marked all above it.
        while let Some(i) = at
            && let Some(mark) = carries.get_mut(i).filter(|mark| !**mark)
        {
            *mark = true;
            at = placed.get(i).and_then(|node| node.parent);
        }
    };
    for (i, placed) in placed.iter().enumerate() {
        let extensions = placed.node.extensions.as_ref();
        let light = extensions.and_then(|extensions| extensions.khr_lights_punctual.as_ref());
        if placed.node.mesh.is_some() || light.is_some() {
            mark(i);
        }
    }
    for joint in json.skins.iter().flat_map(|skin| &skin.joints) {
        if let Some(&node) = place.get(&joint.value()) {
            mark(node);
        }
    }
    carries
}
