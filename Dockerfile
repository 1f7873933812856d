# docker build --tag stereolag . && docker run --memory 4g --publish 8501:8501 stereolag
# See deployment/README.md; tests/package/test_container.py runs the steps without Docker.
FROM python:3.11-slim-bookworm

WORKDIR /srv/stereolag
RUN useradd --uid 10001 --create-home --shell /usr/sbin/nologin stereolag \
    && install --directory --owner stereolag --mode 0700 /var/cache/stereolag

COPY requirements.txt ./
RUN pip install --no-cache-dir --disable-pip-version-check --requirement requirements.txt

COPY .streamlit/config.toml .streamlit/
COPY assets assets
COPY app.py ./
COPY pages pages
COPY stereolag stereolag
RUN python -m compileall -q stereolag

# This user can write only to the machine-code folder, its home and /tmp.
USER 10001
ENV NUMBA_CACHE_DIR=/var/cache/stereolag
ENV PORT=8501
ENV PYTHONUNBUFFERED=1
RUN python -m stereolag.warming && python -P stereolag/commands/serving.py --check

EXPOSE 8501
HEALTHCHECK --interval=60s --timeout=70s --start-period=180s \
    CMD ["sh", "-c", "exec python -P stereolag/commands/serving.py --probe --port $PORT"]
CMD ["sh", "-c", "exec python -P stereolag/commands/serving.py --port $PORT"]
