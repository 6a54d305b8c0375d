"""The way to a scheduler of Dask."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from typing import Any

from ..errors import MissingExtraError, SchedulerLostError, WrongObjectError
from ..letters import what_came

# [s] A scheduler that has not answered by then will not.
_PATIENCE = 20.0


@contextlib.contextmanager
def connected(address: str) -> Iterator[Any]:
    """A client of the scheduler at this address.

    Raises
    ------
    SchedulerLostError
        If it does not answer.
    MissingExtraError
        Without Dask.

    Examples
    --------
    >>> from distributed import LocalCluster
    >>> cluster = LocalCluster(n_workers=1, processes=False, dashboard_address=None)
    >>> with cluster, sp.study.connected(cluster.scheduler_address) as client:
    ...     print(client.submit(abs, -2).result())
    2
    """
    try:
        from distributed import Client
        from distributed.comm.addressing import resolve_address
    except ImportError:
        raise MissingExtraError("a cluster needs Dask; install it with: pip install 'shapephase[study]'") from None
    if not isinstance(address, str):
        raise WrongObjectError(f"address: a text such as tcp://10.0.0.1:8786 is needed, got {what_came(address)}")
    # What it says of lost connections is said by one error.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        # What is no address at all is said at once: a client that was begun would first have to be ended.
        resolve_address(address)
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise SchedulerLostError(f"there is no scheduler at {address!r:.80} ({type(error).__name__})") from None
    try:
        yield client
    finally:
        with contextlib.suppress(Exception):
            client.close(timeout=1.0)
