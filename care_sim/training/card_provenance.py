"""What a card says of where weights were made."""

from importlib.metadata import version

from care_sim.study import provenance


def machine_line() -> str:
    """Processor, cores and system in a few words; no host name."""
    here = provenance.machine()
    return f"{here['processor']}, {here['cores']} cores, {here['system']}"


def package_versions(*packages: str) -> dict[str, str]:
    """The versions of installed packages."""
    return {package: version(package) for package in packages}
