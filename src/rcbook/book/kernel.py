"""An extension of the kernels that a build starts: figures show their numbers, too.

The name of this module stands in the set-up of these kernels; a notebook that is run elsewhere
shows its figures alone.
"""

from IPython.core.formatters import BaseFormatter


def load_ipython_extension(shell) -> None:
    """Let each figure that is shown have its numbers beside its picture, as `text/csv`."""
    # No class has a method of this name; only the figures asked for below get numbers.
    sheets = BaseFormatter(format_type="text/csv", print_method="_repr_csv_")
    # By the class below `Figure`, of which the inline backend takes away all that is registered.
    sheets.for_type_by_name("matplotlib.figure", "FigureBase", _numbers)
    shell.display_formatter.formatters["text/csv"] = sheets


def _numbers(figure) -> str | None:
    from rcbook.pictures.series import long_form  # only where a notebook draws

    return long_form(figure)
