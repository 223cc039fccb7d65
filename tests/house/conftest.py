"""Sources are parsed before the first rule, and are no rule's own time."""

import pytest
from house_sources import imports, nodes, sources


@pytest.fixture(scope="session", autouse=True)
def parsed() -> None:
    for file in sources():
        nodes(file), imports(file)
