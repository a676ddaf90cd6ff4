"""Registries: the metrics, sources or formats of the package by name, each in one module."""

from __future__ import annotations

import importlib
import pkgutil
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from semsig_gis.core.errors import UnknownNameError, nearest_name

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

T = TypeVar("T")
Registered = TypeVar("Registered")


class Registry(Generic[T]):
    """Objects of a kind by name. Each module of `package` registers one under its own name.

    To add one, add its module. A module is imported when its object is used, so that the names are
    known at no cost. Modules in `without` register nothing. `installed` returns the objects of
    other packages; it takes the names that they cannot have.
    """

    def __init__(
        self,
        kind: str,
        package: str,
        path: Iterable[str],
        installed: Callable[[tuple[str, ...]], Mapping[str, T]] = lambda _: {},
        *,
        without: Iterable[str] = (),
    ) -> None:
        self._kind, self._package, self._installed = kind, package, installed
        self._objects: dict[str, Any] = {}
        modules = (module.name for module in pkgutil.iter_modules(path))
        self.names = tuple(name for name in modules if name not in {*without})
        """Names of the modules, in alphabetical order."""

    def register(self, value: Registered, module: str | None = None) -> Registered:
        """Register the object of a module, by default the one that defines it; a decorator."""
        self._objects[(module or value.__module__).rpartition(".")[2]] = value
        return value

    def __getitem__(self, name: str) -> T:
        """Return the object of a name, or raise UnknownNameError."""
        if name in self.names:
            importlib.import_module(f"{self._package}.{name}")
            result: T = self._objects[name]
            return result
        others = self._installed(self.names)
        if name in others:
            return others[name]
        names = sorted({*self.names, *others})
        raise UnknownNameError(
            f"{self._kind} {name!r} is unknown{nearest_name(name, names)}; "
            f"the {self._kind}s are {', '.join(names)}."
        )

    def __iter__(self) -> Iterator[str]:
        """Iterate over all names, sorted."""
        return iter(sorted({*self.names, *self._installed(self.names)}))

    def values(self) -> tuple[T, ...]:
        """Return all objects, by the order of their names."""
        return tuple(self[name] for name in self)
