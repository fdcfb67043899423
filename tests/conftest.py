"""Options of the whole test suite."""


def pytest_addoption(parser):
    parser.addoption(
        "--record-references",
        action="store_true",
        help="store the poses and the picture of tests/system again, on purpose",
    )
