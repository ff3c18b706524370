"""The content of figures, read back from their axes."""


def heights(axes):
    """The heights of every curve and line by its label."""
    return {
        line.get_label(): [round(float(y), 3) for y in line.get_ydata()]
        for line in axes.lines
        if not line.get_label().startswith("_")
    }


def titles(figure):
    """The titles of the panels that show something."""
    return [axes.get_title(loc="left") for axes in figure.axes if axes.axison]


def ticks(axes):
    """The names along the axis to the right."""
    return [label.get_text() for label in axes.get_xticklabels()]
