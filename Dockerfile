# The command line in a container:
#   docker build -t syncplan .
#   docker run --rm -i syncplan plan - < scenario.yaml

FROM python:3.11-slim AS build
WORKDIR /source
RUN python -m venv /opt/syncplan
COPY requirements.lock pyproject.toml README.md ./
COPY syncplan ./syncplan
RUN /opt/syncplan/bin/pip install --no-cache-dir --constraint requirements.lock .

FROM python:3.11-slim
COPY --from=build /opt/syncplan /opt/syncplan
# compiled kernels are kept where the unprivileged user may write, and made once at build time
ENV PATH=/opt/syncplan/bin:$PATH \
    NUMBA_CACHE_DIR=/var/cache/syncplan
RUN useradd --create-home syncplan \
    && install -d -o syncplan /var/cache/syncplan
USER syncplan
WORKDIR /home/syncplan
RUN python -c "from syncplan.ekf import compile_kernels; compile_kernels(6); compile_kernels(100)"
ENTRYPOINT ["syncplan"]
CMD ["--help"]
