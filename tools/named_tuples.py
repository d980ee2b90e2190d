"""Griffe extension: the fields of a NamedTuple stand in its signature, as those of a dataclass."""

from __future__ import annotations

from typing import Any

from griffe import Attribute, Class, Extension, Function, Parameter, ParameterKind, Parameters


class NamedTuples(Extension):
    """Gives each NamedTuple the constructor that Python makes for it."""

    def on_class_members(self, *, cls: Class, **_: Any) -> None:
        """Called when the members of a class are known."""
        if not any(str(base) == "NamedTuple" for base in cls.bases):
            return
        kind = ParameterKind.positional_or_keyword
        fields = [
            Parameter(field.name, annotation=field.annotation, kind=kind, default=field.value)
            for field in cls.members.values()
            if isinstance(field, Attribute) and field.annotation is not None
        ]
        parameters = Parameters(Parameter("self", kind=kind), *fields)
        cls.set_member("__init__", Function("__init__", parameters=parameters, parent=cls))
