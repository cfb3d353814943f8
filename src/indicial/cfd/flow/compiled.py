"""How the flow kernels are compiled.

Products and sums may be contracted to fused ones: faster, and the same for any number of threads.
"""

from __future__ import annotations

from typing import Any

KERNEL: dict[str, Any] = {"cache": True, "parallel": True, "error_model": "numpy", "fastmath": {"contract"}}
"""A loop over cells or faces, by all threads."""

POINTWISE: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": {"contract"}, "forceinline": True}
"""What happens at one face: part of the loop that calls it, so that the loop can be vectorised."""
