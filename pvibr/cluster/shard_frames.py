"""Frames of shards: who draws which, again elsewhere where a worker died, composited in a tree."""

from __future__ import annotations

import contextlib
import time
from typing import Any

import numpy as np

from pvibr.cluster import stages
from pvibr.cluster.clients import same
from pvibr.cluster.shard_pictures import ShardPicture, composited, merged
from pvibr.cluster.shards import bounds_of_shard, picture_of_shard
from pvibr.core.errors import PvibrError

#: Pictures that one task composites, and that the user's process does.
FAN = 4
#: Seconds between looks for workers that died; for which one that takes its place is awaited.
_POLL_SECONDS, _GRACE_SECONDS = 0.5, 8.0
#: Times that a frame is begun again because a worker died.
_MOST_DEATHS = 4


class ShardFrames:
    """Shards of a scene, each at a worker that keeps it."""

    def __init__(self, cluster, scenes, data):
        self._cluster, self._scenes = cluster, scenes
        self._data = [d if d is None else cluster.submit(same, d) for d in data]
        self._homes: list[str | None] = [None] * len(scenes)
        self.deaths = self.nbytes = 0
        told = self._at_homes(lambda: [self._task(bounds_of_shard, k) for k in self._all])
        self.bounds = [bounds for bounds, _ in self._checked(told)]

    @property
    def _all(self) -> range:
        return range(len(self._scenes))

    def picture(self, view) -> ShardPicture:
        """Return the composite of all shards in a view."""
        order = _front_to_back(self.bounds, view.view)

        def submit():
            tasks = [self._task(picture_of_shard, k, view) for k in order]
            while len(tasks) > FAN:
                groups = [tasks[k : k + FAN] for k in range(0, len(tasks), FAN)]
                tasks = [self._cluster.submit(_merged, group) for group in groups]
            return tasks

        pictures = [data for data, _ in self._checked(self._at_homes(submit))]
        self.nbytes = sum(map(len, pictures))
        return composited(map(ShardPicture.unpacked, pictures))

    def _task(self, function, k, *args) -> Any:
        return self._cluster.submit(
            function, self._scenes[k], self._data[k], *args, workers=[self._homes[k]]
        )

    def _at_homes(self, submit) -> list:
        """Return results of tasks, submitted again as long as workers die."""
        while True:
            self._settle()
            futures = submit()
            try:
                while not self._are_done(futures):
                    if self._lost():
                        break
                else:
                    return self._cluster.client.gather(futures)
            finally:
                with contextlib.suppress(Exception):  # a cluster that is gone does nothing anyway
                    self._cluster.client.cancel(futures, force=True)
            self.deaths += 1
            if self.deaths > _MOST_DEATHS:
                raise PvibrError(
                    'workers of shards died again and again; they may lack memory: make more '
                    'and smaller shards, or give workers more memory'
                )

    def _are_done(self, futures) -> bool:
        from distributed import wait

        with contextlib.suppress(TimeoutError):
            wait(futures, timeout=_POLL_SECONDS)
        return all(future.done() for future in futures)

    def _lost(self) -> list[int]:
        """Return the shards whose workers are gone."""
        workers = self._cluster.workers()
        return [k for k in self._all if self._homes[k] not in workers]

    def _settle(self):
        """Give each shard a worker: a free one, which may yet come, else that with the fewest."""
        lost = self._lost()
        deadline = time.monotonic() + (_GRACE_SECONDS if any(self._homes) else 0.0)
        for k in lost:
            self._homes[k] = None
        for k in lost:
            while True:
                counts = {w: self._homes.count(w) for w in self._cluster.workers()}
                fewest = min(counts, key=lambda w: counts[w], default=None)
                if (fewest is not None and not counts[fewest]) or time.monotonic() > deadline:
                    break
                time.sleep(_POLL_SECONDS / 5)
            if fewest is None:
                raise PvibrError('the cluster has no workers: add some and render again')
            self._homes[k] = fewest

    def _checked(self, told) -> list:
        for number, (_, failure) in enumerate(told):
            if failure:
                what, _, trace = failure.partition('\n')
                raise PvibrError(f'shard {number}: {what}\n{trace}')
        return told

    def close(self):
        """Close the plotters of the workers."""
        with contextlib.suppress(Exception):  # a cluster that is gone has closed them
            for scene in self._scenes:
                self._cluster.client.run(stages.leave, scene.key, on_error='ignore')


def _merged(told) -> tuple[bytes, str]:
    failure = next((text for _, text in told if text), '')
    return (b'', failure) if failure else (merged([data for data, _ in told]), '')


def _front_to_back(bounds, view) -> list[int]:
    """Return the order of boxes as an eye sees them, by their centres."""
    centers = np.reshape(bounds, (-1, 3, 2)).mean(2)
    if view.parallel:
        return np.argsort(-(centers @ view.view_from_world[2, :3]), kind='stable').tolist()
    return np.argsort(((centers - view.eye) ** 2).sum(1), kind='stable').tolist()
