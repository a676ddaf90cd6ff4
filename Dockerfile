# The command in a container, of the wheel that `make dist` builds:
#   docker build --tag semsig .
#   docker run --rm --user "$(id -u)" --volume "$PWD:/data" semsig demo --out demo
FROM python:3.13-slim
COPY constraints.txt dist/*.whl /srv/
RUN pip install --no-cache-dir --root-user-action ignore -c /srv/constraints.txt /srv/*.whl \
    && useradd --uid 1000 semsig
# Whoever it runs as can keep caches there.
ENV HOME=/tmp
USER 1000
WORKDIR /data
ENTRYPOINT ["semsig"]
CMD ["--help"]
