"""One service for the whole folder, its simulator as fast as its reader."""

from collections.abc import Iterator

import pytest

from tests.support.service_process import ServiceProcess


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceProcess]:
    with ServiceProcess(tmp_path_factory.mktemp("service")) as made:
        made.start_simulator()
        yield made


@pytest.fixture(scope="session")
def finished(service: ServiceProcess) -> str:
    """A run of one axis that ended well and was not written."""
    run = service.start_run()
    assert service.wait_over(run)["outcome"] == "commissioned"
    return run
