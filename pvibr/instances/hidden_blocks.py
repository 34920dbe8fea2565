"""Blocks of instances that cards of the same set hide, which are then not drawn."""

from __future__ import annotations

import weakref
from functools import partial
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core.costs import Backoff
from pvibr.gl import nbytes_of
from pvibr.gl.driver import driver_of
from pvibr.instances.card_layers import range_uniforms
from pvibr.instances.cards import SPLAT
from pvibr.things.depth_prepass import TILE, DepthPrepass
from pvibr.things.occlusion_culling import behind, likely_seen, on_screen
from pvibr.things.shader_draws import ShaderDraws, draw_actor

_LEAST = 512  # instances in view from which a depth prepass may pay
# Expected layers of opaque pixels before a block that is presumed hidden, the more the better;
# greatest share of blocks in the prepass.
_LAYERS, _WORTH = (5.0, 8.0, 12.0), 0.5
_GAIN = 0.2  # least share of hidden blocks for the next frame to try
_TILE_PX = 32.0  # least side of the squares of pixels in which layers are counted
# Coverages from and to, and opacity: what blends lets through what is behind it.
_OPAQUE = 0.999, 2.0, 1.0
_PAUSE = 8  # frames without a try after a failure


class HiddenBlocks:
    """Proves which blocks are behind opaque pixels of nearer cards."""

    # The prepass draws the very pixels of cards that the frame will draw opaque, at the depth of
    # the far end of their instances: what is behind these is hidden, whatever the levels.

    def __init__(self, binder):
        self._binder, self._prepass = binder, DepthPrepass()
        self._draws: dict = {}
        self._pause = Backoff(_PAUSE, _PAUSE)
        self._is_software: bool | None = None

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(*self._draws.values(), self._prepass)

    def release(self, window):
        """Free GPU memory; the context is current."""
        self._prepass.release()
        for draws in self._draws.values():
            draws.release(window)
        self._draws, self._pause, self._is_software = {}, Backoff(_PAUSE, _PAUSE), None

    def cull(self, frame, groups, choices) -> list[dict]:
        """Return what groups draw as cards, and leave them as meshes, what is not hidden."""
        in_view = sum(len(blocks) * blocks.unit for c in choices for blocks in c.values())
        if in_view < _LEAST or frame.casting or not frame.own or not self._may_hide(frame):
            return choices
        farthest_depths = self._farthest_depths(frame, list(zip(groups, choices, strict=True)))
        if farthest_depths is None:
            return choices
        are_behind = partial(behind, frame, farthest_depths, TILE)
        shown_choices = [
            group.without_hidden(choice, are_behind)
            for group, choice in zip(groups, choices, strict=True)
        ]
        shown, in_view = (
            sum(len(blocks) for choice in all_choices for blocks in choice.values())
            for all_choices in (shown_choices, choices)
        )
        if shown > (1 - _GAIN) * in_view:
            self._pause.failed()
        return shown_choices

    def _may_hide(self, frame) -> bool:
        """Return whether what is hidden from the frame's eye may be left out."""
        # A render pass may draw at another resolution, stereo moves the eye, and a GPU draws all
        # in less time than it takes to answer.
        if self._is_software is None:
            self._is_software = driver_of(frame.window).is_software
        if not self._is_software or frame.renderer.GetPass() is not None:
            return False
        return frame.parallel or not frame.clip_from_view[:2, 3].any()

    def _farthest_depths(self, frame, pairs) -> np.ndarray | None:
        """Return the farthest depth of opaque cards in each square of pixels, if that may pay."""
        cards = [
            (group.cards.layers[name], blocks)
            for group, choice in pairs
            for name, blocks in choice.items()
            if name != SPLAT.name and not group.atlas.animated
        ]
        in_view = sum(len(blocks) * blocks.unit for _, blocks in cards)
        if in_view < _LEAST or self._pause.waits():
            return None
        likely = _likely_seen(frame, cards)
        if likely is None:
            self._pause.failed()
            return None
        actors: list = []
        for (layer, blocks), is_likely in zip(cards, likely, strict=True):
            if layer not in self._draws:
                self._draws[layer] = _HidingCards(layer)
            nearest_first = blocks.where(np.flatnonzero(is_likely)[::-1])
            actors += self._draws[layer].show(nearest_first)
        return self._prepass.farthest_depths(frame, actors, self._binder)


def _likely_seen(frame, cards) -> list[np.ndarray] | None:
    """Estimate which blocks of each layer of cards are visible, None if too many may be."""
    middles, areas, sides = [], [], []
    for layer, blocks in cards:
        low, high = on_screen(frame, blocks.centers, blocks.radii)
        corners = np.nan_to_num(np.clip([low, high], -1.0, max(frame.size)), nan=-1.0)
        middles.append(corners.mean(0))
        sides.append(corners[1] - corners[0])
        sizes = np.minimum(blocks.sizes, frame.size[1])
        areas.append(blocks.unit * layer.cards.atlas.opaque_share * sizes**2)
    depths = np.concatenate([blocks.depths for _, blocks in cards])
    nearest_first = np.argsort(-depths, kind='stable')
    middle, area = (np.concatenate(values)[nearest_first] for values in (middles, areas))
    tile = max(_TILE_PX, float(np.concatenate(sides).mean()))
    nearest_seen = None
    for layers in _LAYERS:
        more_seen = likely_seen(middle, area, layers, tile)
        if more_seen.mean() > _WORTH:
            break
        nearest_seen = more_seen
    if nearest_seen is None:
        return None
    is_seen = np.empty(len(nearest_first), bool)
    is_seen[nearest_first] = nearest_seen
    return np.split(is_seen, np.cumsum([len(blocks) for _, blocks in cards])[:-1])


class _HidingCards(ShaderDraws):
    """The opaque pixels of a layer's cards, drawn for their depth."""

    def __init__(self, layer):
        cards = layer.cards
        kind = cards.atlas.animated, cards.atlas.turntable is not None
        feature = layer.shader.feature(False, *kind, deep=False, hides=True)
        super().__init__(
            chunk=cards.chunk,
            prop=pv.Property(lighting=False),
            feature=feature,
            translucent=False,
            binder=cards.binder,
        )
        self._layer, self._hiding = weakref.proxy(layer), feature
        self._blocks: Any = None

    def show(self, blocks) -> list:
        """Return the actors that draw blocks, nearest first."""
        self._blocks, unit = blocks, blocks.unit
        self._share_cards()
        self.upload(self._layer.window, blocks.table)
        step = self.chunk // unit
        spans = [(k * unit, min(k + step, len(blocks))) for k in range(0, len(blocks), step)]
        self.grow(len(spans), self._new_actor)
        self.show_spans(spans)
        return self.actors[: len(spans)]

    def _share_cards(self):
        """Use the corners of the layer's own cards, whose bounds may be new."""
        mesh = self._layer.fringe.mapper.GetInput()
        if self.mapper.GetInput() is not mesh:
            self.mapper.SetInputData(mesh)

    def _new_actor(self):
        actor = draw_actor(self.mapper, self.material, False)
        self._hiding.attach(actor)
        return actor

    def _inputs(self):
        textures, view_uniforms, uniforms = self._layer.inputs()
        uniforms = (
            uniforms
            | range_uniforms(self._blocks.ranges)
            | {
                'ibr_unit': self._blocks.unit,
                'ibr_part': _OPAQUE,
                'ibr_nearest_first': 0,
                'ibr_back': 0.0,
            }
        )
        return textures, view_uniforms | {'ibr_fades': 0}, uniforms
