# The edge in a container: headless, an ordinary user, and a root that can be read-only. How to build it and run it,
# and which ports and flags it needs: docs/container.md.
FROM python:3.11-slim-bookworm AS build

# Extras of enliven-edge, with commas: oak for an OAK camera, controls for pedals and panels, physics for towers.
ARG EXTRAS=controls,physics

WORKDIR /src
COPY VERSION constraints.txt ./
COPY shared ./shared
COPY edge ./edge
COPY firmware_configs ./firmware_configs
RUN python3 -m pip wheel --no-cache-dir -q -c constraints.txt -w /wheels ./shared "./edge[${EXTRAS}]"
# Installed from the wheels alone, so that the image holds what was built above and nothing that an index changed.
# Byte code is compiled here: a read-only root could not keep it.
RUN python3 -m venv --without-pip /opt/enliven \
    && python3 -m pip --python /opt/enliven/bin/python install --no-cache-dir -q --no-index /wheels/*.whl


FROM python:3.11-slim-bookworm

RUN useradd --uid 10001 --user-group --create-home --home-dir /var/lib/enliven --shell /usr/sbin/nologin enliven \
    && install -d -o enliven -g enliven /var/lib/enliven/recordings
COPY --from=build /opt/enliven /opt/enliven

# All that the edge writes is in one folder, a volume: settings, compiled kernels, recordings.
ENV PATH=/opt/enliven/bin:$PATH \
    HOME=/var/lib/enliven \
    XDG_STATE_HOME=/var/lib/enliven/state \
    XDG_CACHE_HOME=/var/lib/enliven/cache \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1
USER 10001:10001
WORKDIR /var/lib/enliven
VOLUME /var/lib/enliven

# Poses, and commands. Nothing reaches them until the edge is told to listen: --host 0.0.0.0.
EXPOSE 5580 5581

# Not healthy: no heartbeat, no sensor, or the edge reports something worse than a note. It may compile at first.
HEALTHCHECK --interval=30s --timeout=30s --start-period=900s --retries=3 \
    CMD ["enliven", "doctor", "--remote", "127.0.0.1"]

ENTRYPOINT ["enliven", "edge"]
# Without arguments: the shipped recording, again and again, heard inside of the container only.
CMD ["--loop"]
