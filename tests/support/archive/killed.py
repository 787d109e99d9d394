"""A run folder whose process is gone."""

from commissioner.run.archive.folder import RunFolder


def die(folder: RunFolder) -> None:
    """As SIGKILL leaves it: nothing closed in an orderly way, files and lock dropped by the system."""
    folder._journal.close()
    folder._blocks.close()
    assert folder._lock is not None
    folder._lock.release()
