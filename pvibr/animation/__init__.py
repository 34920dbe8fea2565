"""Skeletons, clips, blending, inverse kinematics and vertex animation, in float64 numpy."""

from __future__ import annotations

from pvibr import lazy_exports

_EXPORTS = {
    'Aim': 'pvibr.animation.constraints',
    'AnimationLayer': 'pvibr.animation.mixer',
    'ClampToLimits': 'pvibr.animation.constraints',
    'Clip': 'pvibr.animation.clip',
    'ClipSource': 'pvibr.animation.mixer',
    'CopyTransform': 'pvibr.animation.constraints',
    'Correctives': 'pvibr.animation.correctives',
    'Curve': 'pvibr.animation.curves',
    'Figure': 'pvibr.animation.figure',
    'FigureMesh': 'pvibr.animation.figure_mesh',
    'FrameRange': 'pvibr.animation.vertex_animation_states',
    'GltfError': 'pvibr.io.gltf_file',
    'InverseKinematics': 'pvibr.animation.ik_step',
    'joint_mask': 'pvibr.animation.blending',
    'JointLimit': 'pvibr.animation.joint_limits',
    'Mixer': 'pvibr.animation.mixer',
    'Morphs': 'pvibr.animation.morphs',
    'Pose': 'pvibr.animation.pose',
    'PoseSource': 'pvibr.animation.mixer',
    'PoseSpace': 'pvibr.animation.correctives',
    'read_gltf': 'pvibr.animation.read_gltf',
    'Rig': 'pvibr.animation.rig',
    'Skeleton': 'pvibr.animation.skeleton',
    'Skin': 'pvibr.animation.figure_mesh',
    'StateGraph': 'pvibr.animation.states',
    'SyncedClips': 'pvibr.animation.mixer',
    'Track': 'pvibr.animation.clip',
    'VertexAnimation': 'pvibr.animation.vertex_animation',
    'VertexAnimationStates': 'pvibr.animation.vertex_animation_states',
}

__all__ = [*_EXPORTS]  # noqa: PLE0604, RUF100
__getattr__, __dir__ = lazy_exports(__name__, _EXPORTS)
