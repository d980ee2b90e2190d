"""Edge functions of a network, one by one, as the firmware evaluates them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from bms.arrays import Float32Array
from bms.firmware._firmware import ffi, lib
from bms.kan.network import Network
from bms.tables import network_tables


class CompiledEdges:
    """The edges of a network in C, numbered layer by layer, output by output, input by input."""

    def __init__(self, network: Network) -> None:
        """Raises InputError when the network exceeds the firmware's maxima."""
        self._model = ffi.new("kan_model_t *", network_tables(network).fields(network, 1.0))

    def evaluate(
        self,
        edge: int,
        arguments: Float32Array,
        values: Float32Array,
        in_domain: npt.NDArray[np.uint8],
    ) -> None:
        """Write value and domain flag (1 or 0) of the edge at every argument; all are (N,)."""
        lib.host_edge_values(
            self._model,
            edge,
            ffi.from_buffer("float[]", arguments),
            len(arguments),
            ffi.from_buffer("float[]", values, require_writable=True),
            ffi.from_buffer("uint8_t[]", in_domain, require_writable=True),
        )
