# The README's two commands on a new Debian 13:
#   docker build --tag robotball . && docker run --rm robotball
FROM debian:13-slim
RUN apt-get update && \
    apt-get install --yes --no-install-recommends ca-certificates git make python3 && \
    rm -rf /var/lib/apt/lists/*
WORKDIR /robotball
COPY . .
RUN make demo
CMD ["make", "test"]
