"""Pass NamedTuples to compiled functions by reference instead of by value.

Numba passes a tuple by value, number by number: two hundred numbers for a tuple of thirty arrays, in each call. Compiling such
calls took longer than compiling the functions.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.datamodel.models import PrimitiveModel
from numba.core.datamodel.registry import register_default
from numba.core.imputils import impl_ret_borrowed
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic


class Reference(types.Type):  # type: ignore[misc]
    """Numba type of a reference to a NamedTuple of the type ``of``."""

    def __init__(self, of: Any) -> None:
        self.dtype = of
        super().__init__(name=f"Reference({of})")


@register_default(Reference)
class _Model(PrimitiveModel):  # type: ignore[misc]
    def __init__(self, models: Any, reference: Reference) -> None:
        super().__init__(models, reference, models[reference.dtype].get_value_type().as_pointer())


@infer_getattr
class _Fields(AttributeTemplate):  # type: ignore[misc]
    key = Reference

    def generic_resolve(self, reference: Reference, name: str) -> Any:
        fields = reference.dtype.fields
        if name not in fields:
            return None
        kind = reference.dtype[fields.index(name)]
        return Reference(kind) if isinstance(kind, types.NamedTuple) else kind


@lower_getattr_generic(Reference)
def _field(context: Any, builder: Any, reference: Reference, value: Any, name: str) -> Any:
    place = reference.dtype.fields.index(name)
    found, kind = cgutils.gep_inbounds(builder, value, 0, place), reference.dtype[place]
    # a tuple within the tuple is passed by reference, too
    return (
        found if isinstance(kind, types.NamedTuple) else impl_ret_borrowed(context, builder, kind, builder.load(found))
    )


@intrinsic
def refer(typing_context, fields):
    """Return a reference to a NamedTuple; it is valid until the function that calls `refer` returns."""

    def generate(context, builder, signature, arguments):
        return cgutils.alloca_once_value(builder, arguments[0])

    return Reference(fields)(fields), generate
