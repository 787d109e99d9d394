"""One service for the whole folder, its simulator as fast as its reader; one browser for all its users."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser

from tests.support.service.browser import chromium
from tests.support.service.described import Description
from tests.support.service.service_process import ServiceProcess

PAGE_LOST_S = 5.0


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceProcess]:
    settings = f"page_lost_s = {PAGE_LOST_S}\nhand_over_s = 60.0\naxes_deg = [0]"
    with ServiceProcess(tmp_path_factory.mktemp("service"), settings=settings) as made:
        described = Description(made.client.get("/openapi.json").json())
        made.client.event_hooks["response"].append(described.watch)
        made.start_simulator()
        yield made


@pytest.fixture(scope="session")
def finished(service: ServiceProcess) -> str:
    """A run of one axis that ended well and was not written."""
    run = service.start_run(axes_deg=[0])
    assert service.wait_over(run)["outcome"] == "commissioned"
    return run


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    with chromium() as made:
        yield made
