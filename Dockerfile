# docker build -t stymo . && docker run -p 8080:8080 stymo stymo-view --host 0.0.0.0 --port 8080
FROM debian:12 AS build
COPY . /src
WORKDIR /src
RUN scripts/install_packages.sh dpkg-dev file help2man
RUN cmake --preset package && cmake --build --preset package && cpack --preset package

FROM debian:12-slim
COPY --from=build /src/build-package/stymo_*.deb /tmp/
RUN apt-get update && apt-get install --yes --no-install-recommends /tmp/stymo_*.deb && rm /tmp/*.deb
CMD ["stymo-fit", "--help"]
