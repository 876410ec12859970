//! Cameras that animations move: by channels on their node, or on any node above it.

use super::accessor::Accessors;
use super::cameras::pose;
use super::curve::Curve;
use super::error::{GltfError, get};
use super::nodes::{self, Placed, Trs};
use crate::camera::CameraError;
use crate::error::Warning;
use crate::scene_file::numbers::MAX_LENGTH;
use ::gltf::json::Root;
use ::gltf::json::animation::{Animation, Channel, Property};
use ::gltf::json::validation::Checked;
use glam::{Affine3A, DAffine3};
use std::collections::BTreeMap;

/// How an animation moves a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraAnimation {
    /// From the root of the scene to the camera's node.
    chain: Vec<Link>,
    /// Times of the first and the last keyframe in seconds.
    span: [f32; 2],
}

/// What carries the next link, and at last the camera.
#[derive(Clone, Debug, PartialEq)]
enum Link {
    /// Nodes that stand still.
    Still(DAffine3),
    /// A node that moves.
    Moved(Box<MovedNode>),
}

/// A node that an animation moves.
#[derive(Clone, Debug, PartialEq)]
struct MovedNode {
    /// What holds where no curve says otherwise.
    rest: Trs,
    curves: Curves,
}

/// Curves of the properties of one node.
#[derive(Clone, Debug, Default, PartialEq)]
struct Curves {
    translation: Option<Curve>,
    rotation: Option<Curve>,
    scale: Option<Curve>,
}

impl CameraAnimation {
    /// Times of the first and the last keyframe in seconds, from 0 on. Before and after them the camera stands still.
    pub fn span(&self) -> [f32; 2] {
        self.span
    }

    /// From camera space to the world at `time` in seconds; a rotation and a translation, whatever scale, shear or mirroring the
    /// nodes have then.
    ///
    /// # Errors
    /// Where the nodes flatten the camera or carry it further than 1e12 m from the origin.
    pub fn at(&self, time: f32) -> Result<Affine3A, CameraError> {
        let mut world = DAffine3::IDENTITY;
        for link in &self.chain {
            world *= match link {
                Link::Still(transform) => *transform,
                Link::Moved(node) => node.at(time).ok_or(CameraError::Transform)?.transform(),
            };
        }
        let eye = world.translation.as_vec3();
        if nodes::is_invertible(&world.matrix3)
            && eye.is_finite()
            && eye.abs().max_element() <= MAX_LENGTH
        {
            Ok(pose(&world, eye))
        } else {
            Err(CameraError::Transform)
        }
    }
}

impl MovedNode {
    /// The node's own transform at `time`; `None` where it has no rotation then.
    fn at(&self, time: f32) -> Option<Trs> {
        let Curves {
            translation,
            rotation,
            scale,
        } = &self.curves;
        let Trs {
            translation: at_rest,
            rotation: turned,
            scale: scaled,
        } = self.rest;
        Some(Trs {
            translation: translation.as_ref().map_or(at_rest, |c| c.vector(time)),
            rotation: match rotation {
                Some(curve) => curve.rotation(time)?,
                None => turned,
            },
            scale: scale.as_ref().map_or(scaled, |c| c.vector(time)),
        })
    }
}

/// How the first animation that moves it moves the camera on node number `camera` of `placed`, if any does.
pub(super) fn of_camera(
    json: &Root,
    accessors: Accessors<'_>,
    placed: &[Placed<'_>],
    camera: usize,
    warnings: &mut Vec<Warning>,
) -> Result<Option<CameraAnimation>, GltfError> {
    let mut chain: Vec<_> = std::iter::successors(placed.get(camera), |node| {
        node.parent.and_then(|parent| placed.get(parent))
    })
    .collect();
    chain.reverse();
    let mut on_chain: BTreeMap<_, _> = chain
        .iter()
        .map(|node| (node.index, Curves::default()))
        .collect();
    let moves = |animation: &Animation| {
        let targets = animation.channels.iter().map(|channel| &channel.target);
        targets
            .filter(|target| target.path != Checked::Valid(Property::MorphTargetWeights))
            .any(|target| on_chain.contains_key(&target.node.value()))
    };
    let mut moving = json.animations.iter().enumerate().filter(|(_, a)| moves(a));
    let Some((index, animation)) = moving.next() else {
        return Ok(None);
    };
    let pointer = format!("/animations/{index}");
    let n_others = moving.count();
    if n_others > 0 {
        let name = animation.name.clone().unwrap_or_else(|| index.to_string());
        warnings.push(Warning::Gltf {
            problem: format!(
                "{} animations move the camera, of which the first, \"{name}\", is used",
                n_others + 1
            ),
            pointer: pointer.clone(),
        });
    }
    for (i, channel) in animation.channels.iter().enumerate() {
        if let Some(curves) = on_chain.get_mut(&channel.target.node.value()) {
            let at = format!("{pointer}/channels/{i}");
            read_channel(accessors, animation, channel, curves, &pointer, &at)?;
        }
    }
    let mut links = Vec::new();
    let mut span: Option<[f32; 2]> = None;
    for node in chain {
        let curves = on_chain.remove(&node.index).unwrap_or_default();
        for curve in curves.all() {
            let [first, last] = curve.span();
            let [earliest, latest] = span.unwrap_or([first, last]);
            span = Some([first.min(earliest), last.max(latest)]);
        }
        // The walk has warned of what is odd about the nodes at rest.
        let silent = &mut Vec::new();
        if curves.all().next().is_some() {
            if node.node.matrix.is_some() {
                return Err(node.fault(
                    "has a matrix and is animated; an animated node needs translation, rotation and scale instead",
                ));
            }
            let rest = nodes::trs(node.index, node.node, silent)?;
            links.push(Link::Moved(Box::new(MovedNode { rest, curves })));
            continue;
        }
        let local = nodes::local_transform(node.index, node.node, silent)?;
        match links.last_mut() {
            Some(Link::Still(before)) => *before *= local,
            _ => links.push(Link::Still(local)),
        }
    }
    Ok(span.map(|span| CameraAnimation { chain: links, span }))
}

impl Curves {
    fn all(&self) -> impl Iterator<Item = &Curve> {
        [&self.translation, &self.rotation, &self.scale]
            .into_iter()
            .flatten()
    }
}

/// Reads what the channel at `at`, of the animation at `pointer`, does to its node.
fn read_channel(
    accessors: Accessors<'_>,
    animation: &Animation,
    channel: &Channel,
    curves: &mut Curves,
    pointer: &str,
    at: &str,
) -> Result<(), GltfError> {
    let path_at = || format!("{at}/target/path");
    let Checked::Valid(property) = channel.target.path else {
        return Err(GltfError::value(
            path_at(),
            "an unknown name",
            "allowed are translation, rotation, scale and weights",
        ));
    };
    let curve = match property {
        Property::Translation => &mut curves.translation,
        Property::Rotation => &mut curves.rotation,
        Property::Scale => &mut curves.scale,
        Property::MorphTargetWeights => return Ok(()),
    };
    if curve.is_some() {
        return Err(GltfError::value(
            path_at(),
            "a second channel for one property of one node",
            "an animation has at most one",
        ));
    }
    let index = channel.sampler.value();
    let samplers = &animation.samplers;
    let sampler = get(samplers, index, "samplers in this animation", || {
        format!("{at}/sampler")
    })?;
    let sampler_at = format!("{pointer}/samplers/{index}");
    *curve = Some(Curve::read(accessors, sampler, property, &sampler_at)?);
    Ok(())
}
