"""Recordings, read back."""

from collections import defaultdict


class Read:
    """What a recording holds: `fixed` entities, and of the others their rows by keyframe."""

    def __init__(self, path):
        from rerun.chunk import RrdReader

        self.fixed, self.rows, self.seconds = {}, defaultdict(dict), {}
        for chunk in RrdReader(path).stream().to_chunks():
            name = chunk.entity_path.lstrip("/")
            for row in chunk.to_record_batch().to_pylist():
                if chunk.is_static:
                    self.fixed.setdefault(name, {}).update(row)
                else:
                    self.rows[name][row["keyframe"]] = row
                    self.seconds[row["keyframe"]] = row["seconds"].total_seconds()

    def column(self, entity, component):
        """The value of a component at every keyframe, in order: the latest that was logged."""
        values, latest = [], None
        for keyframe in sorted(self.seconds) if entity in self.rows else ():
            latest = self.rows[entity].get(keyframe, {component: latest})[component]
            values.append(latest)
        return values

    def numbers(self, entity):
        """The scalars of an entity."""
        return [value for (value,) in self.column(entity, "Scalars:scalars")]
