# The service, and the command line, in a container:
#
#   docker build -t syncplan .
#   docker run -p 127.0.0.1:8000:8000 -v syncplan:/var/lib/syncplan -e SYNCPLAN_API_KEYS syncplan
#   docker run --rm -i syncplan plan - < scenario.yaml
#
# A container listens to everybody who can reach it. So it refuses to start without keys, on
# purpose: SYNCPLAN_API_KEYS=NAME:KEY, the key of 16 characters or more.
# With PostgreSQL and workers: compose.yaml. The same steps without a container: docker/steps.sh.

FROM python:3.11-slim AS build
WORKDIR /source
COPY pyproject.toml README.md ./
COPY syncplan ./syncplan
COPY api ./api
COPY docker ./docker
COPY examples ./examples
RUN PIP_NO_CACHE_DIR=1 sh docker/install.sh /source /opt/syncplan

FROM python:3.11-slim
COPY --from=build /opt/syncplan /opt/syncplan
COPY docker/warm_up.py docker/healthcheck.py /opt/syncplan/share/
ENV PATH=/opt/syncplan/bin:$PATH \
    NUMBA_CACHE_DIR=/var/cache/syncplan \
    SYNCPLAN_DATA_DIR=/var/lib/syncplan \
    SYNCPLAN_HOST=0.0.0.0 \
    SYNCPLAN_PORT=8000 \
    OTEL_SERVICE_NAME=syncplan
RUN useradd --uid 10001 --create-home syncplan \
    && install -d -o syncplan -g syncplan -m 700 /var/cache/syncplan /var/lib/syncplan
USER syncplan
WORKDIR /home/syncplan
# made once, where the user may write: on another kind of processor they are compiled anew
RUN python /opt/syncplan/share/warm_up.py
VOLUME /var/lib/syncplan
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=5s --start-period=20s \
    CMD ["python", "/opt/syncplan/share/healthcheck.py"]
ENTRYPOINT ["syncplan"]
CMD ["serve"]
