"""`palpate prepare`: compile beforehand what the first use would compile."""

from __future__ import annotations

__all__ = ["prepare"]


def prepare() -> None:
    """Compile palpate's kernels now, so that the first use doesn't wait.

    It takes about two minutes on two cores, once; what is compiled is kept beside the package, or
    in your cache folder where the package can't be written. For images and clusters: run it as the
    user who installs, and everybody who uses that installation on such a processor finds it done.
    """
    from ...recognizer.kernel_store import kernel_folder
    from ...recognizer.preparing import prepare as compile_all

    folder = kernel_folder()
    if folder is None:
        raise ValueError("compiled kernels can be kept nowhere: no folder can be written")
    compiled = compile_all()
    print(f"{'compiled' if compiled else 'compiled already'}, kept in {folder}")
