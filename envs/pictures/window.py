"""A window that shows pictures as they come, by matplotlib's interactive backend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

DPI = 100


def toolkit_name() -> str | None:
    """What matplotlib would open windows with, such as "qt"; None where it can't.

    Asking makes matplotlib choose a backend, if the user hasn't.
    """
    import matplotlib.pyplot as plt
    from matplotlib.backends.registry import backend_registry

    module = backend_registry.load_backend_module(plt.get_backend())
    return module.FigureCanvas.required_interactive_framework


@dataclass(frozen=True, eq=False)
class _Shown:
    """An open window."""

    figure: Figure
    image: AxesImage


class Window:
    """One picture at a time. The window opens with the first and closes with `close`."""

    def __init__(self, title: str) -> None:
        """Prepare a window; none opens yet.

        Raises:
            gymnasium.error.DependencyNotInstalled: no window can open here.
        """
        self.title = title
        self._shown: _Shown | None = None
        if toolkit_name() is None:
            import matplotlib.pyplot as plt

            raise gymnasium.error.DependencyNotInstalled(
                "render_mode 'human' needs a window, and matplotlib found no way to open one"
                f" (its backend is {plt.get_backend()!r}). Use render_mode 'rgb_array', or run"
                " where there is a display and a toolkit that matplotlib knows, such as PyQt6"
            )

    def show(self, picture: NDArray[np.uint8]) -> None:
        """Show a picture, (h, w, 3), in place of the one before; a closed window opens anew."""
        import matplotlib.pyplot as plt

        if self._shown is None or not plt.fignum_exists(self._shown.figure.number):
            self._shown = self._open(picture)
        self._shown.image.set_data(picture)
        self._shown.figure.canvas.draw()
        self._shown.figure.canvas.flush_events()

    def close(self) -> None:
        """Close the window; it may have been closed already."""
        if self._shown is not None:
            import matplotlib.pyplot as plt

            plt.close(self._shown.figure)
        self._shown = None

    def _open(self, picture: NDArray[np.uint8]) -> _Shown:
        import matplotlib.pyplot as plt

        height, width = picture.shape[:2]
        figure = plt.figure(figsize=(width / DPI, height / DPI), dpi=DPI)
        if figure.canvas.manager is not None:
            figure.canvas.manager.set_window_title(self.title)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        image = axes.imshow(picture)
        figure.show()
        return _Shown(figure, image)

    def __getstate__(self) -> dict[str, Any]:
        """A copy, by pickle for instance, opens a window of its own."""
        return {"title": self.title, "_shown": None}
