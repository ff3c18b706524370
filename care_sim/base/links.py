"""The links at the top of a clone, which lead people to folders of `care_sim`."""


def refuse_link(package: str) -> None:
    """Raise ImportError for a package that is imported by its link: its registries would be others
    than those of `care_sim`.
    """
    if not package.startswith("care_sim."):
        raise ImportError(f"{package} is a link and no package: import care_sim.{package} instead")
