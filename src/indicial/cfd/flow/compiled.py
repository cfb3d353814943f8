"""How the flow kernels are compiled.

In strict arithmetic: to let the compiler reorder or fuse operations was measured, and gains nothing here.
"""

from __future__ import annotations

from typing import Any

KERNEL: dict[str, Any] = {"cache": True, "parallel": True, "error_model": "numpy"}
"""A loop over cells or faces, by all threads."""

POINTWISE: dict[str, Any] = {"cache": True, "error_model": "numpy", "forceinline": True}
"""What happens at one face: part of the loop that calls it, so that the loop can be vectorised."""
