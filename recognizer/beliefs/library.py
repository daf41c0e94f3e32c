"""A library: models with all that is built of each once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ..models.polygon import Polygon
from ..models.polyhedron import Polyhedron
from ..poses.entry import OutlineEntry, SolidEntry


@dataclass(frozen=True, eq=False)
class Library:
    """Solids or outlines, prepared; a belief holds it, so that its poses can be looked at."""

    solids: tuple[SolidEntry, ...]
    outlines: tuple[OutlineEntry, ...]
    edges: bool
    """Whether contacts may lie on edges and vertices of solids too."""

    @classmethod
    def of(
        cls, models: Iterable[Polyhedron | Polygon], *, edges: bool, cache: Path | None
    ) -> Library:
        """Prepare models.

        Args:
            models: solids or outlines; names must differ.
            edges: whether contacts may lie on edges and vertices of solids too.
            cache: a folder to keep range tables in between runs, by content.

        Raises:
            ValueError: no model at all, two of the same name, solids and outlines together, edges
                and vertices of outlines.
        """
        everything = tuple(models)
        if not everything:
            raise ValueError("a recogniser needs at least one model; the library is empty")
        names = [model.name for model in everything]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two models are called {twice[0]!r}; names must differ")
        solids = tuple(model for model in everything if isinstance(model, Polyhedron))
        outlines = tuple(model for model in everything if isinstance(model, Polygon))
        if solids and outlines:
            raise ValueError(
                f"{solids[0].name!r} is a solid and {outlines[0].name!r} an outline of the plane;"
                " a library has one kind"
            )
        if outlines and edges:
            raise ValueError("features 'all' is for solids; outlines have edges alone")
        return cls(
            tuple(SolidEntry.of(model, edges=edges, folder=cache) for model in solids),
            tuple(OutlineEntry.of(model) for model in outlines),
            edges,
        )

    @property
    def entries(self) -> tuple[SolidEntry | OutlineEntry, ...]:
        """All models, in the order in which they were given."""
        return (*self.solids, *self.outlines)

    @property
    def dimension(self) -> int:
        """3 for solids, 2 for outlines."""
        return 3 if self.solids else 2

    @property
    def models(self) -> tuple[Polyhedron, ...]:
        """The solids as they were given."""
        return tuple(entry.model for entry in self.solids)

    def solid(self, name: str) -> SolidEntry:
        """A solid with all that was built of it.

        Raises:
            ValueError: no solid of that name.
        """
        entry = self.entry(name)
        if isinstance(entry, OutlineEntry):
            raise ValueError(f"{name!r} is an outline; it has edges alone, and planar tables")
        return entry

    def entry(self, name: str) -> SolidEntry | OutlineEntry:
        """A model with all that was built of it.

        Raises:
            ValueError: no model of that name.
        """
        for entry in self.entries:
            if entry.model.name == name:
                return entry
        known = ", ".join(entry.model.name for entry in self.entries)
        raise ValueError(f"no model is called {name!r}; there are: {known}")

    def alike(self, other: Library) -> bool:
        """Whether interpretations over the other are interpretations over this one."""
        if self is other:
            return True
        first, second = (
            [(e.model.name, len(e.features)) for e in each.entries] for each in (self, other)
        )
        return first == second
