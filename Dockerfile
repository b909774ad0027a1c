# RayFarm as one image: server, llvmpipe worker, adb worker, command line. docker-compose.yml says how it is used.
# The base is pinned by its dated tag, and Python's packages by constraints.txt. Mesa here is Debian's, 25.0.
ARG BASE=debian:trixie-20251117-slim

FROM ${BASE} AS base
WORKDIR /rayfarm
COPY tools/system_packages.sh tools/
RUN apt-get update && apt-get install -y --no-install-recommends make postgresql-client python3 python3-venv && \
    tools/system_packages.sh run && rm -rf /var/lib/apt/lists/*

# What runs on phones.
FROM base AS agent
COPY pyproject.toml ./
COPY agent_android agent_android
RUN tools/system_packages.sh agent && python3 -m agent_android.build

# Mesa's compilers for phone GPUs: about 16 CPU minutes, made anew only when their script changes.
FROM base AS phone-compiler
COPY Makefile constraints.txt ./
COPY tools/phone_compiler.sh tools/
RUN RAYFARM_PHONE_COMPILER=/phone-compiler make phone-compiler

FROM base AS program
COPY . ./
RUN make

FROM base
COPY --from=program /rayfarm /rayfarm
COPY --from=agent /rayfarm/agent_android/build agent_android/build
COPY --from=phone-compiler /phone-compiler /phone-compiler
ENV PATH=/rayfarm/.venv/bin:/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
ENV HOME=/var/lib/rayfarm
ENV RAYFARM_PHONE_COMPILER=/phone-compiler
ENV RAYFARM_LOCKS=/var/lib/rayfarm/locks
ENV NUMBA_CACHE_DIR=/var/lib/rayfarm/.cache/numba
ENV PYTHONUNBUFFERED=1
# A volume takes the owner of the folder that it is laid over.
RUN useradd --uid 10001 --user-group --no-create-home --home-dir /var/lib/rayfarm rayfarm && \
    mkdir -p /var/lib/rayfarm/.android && chown -R rayfarm:rayfarm /var/lib/rayfarm
USER 10001:10001
CMD ["rayfarm", "--help"]
