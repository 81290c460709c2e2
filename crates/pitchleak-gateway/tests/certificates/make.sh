#!/bin/sh
# Makes what the tests' broker shows and asks for; nothing of it protects anything.
set -eu
cd "$(dirname "$0")"
ec="-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes"
for name in authority another-authority; do
    openssl req -x509 $ec -days 36500 -subj "/CN=$name" -keyout $name.key -out $name.pem
done
openssl req $ec -subj /CN=localhost -keyout broker.key -out broker.csr
printf 'subjectAltName=DNS:localhost,IP:127.0.0.1\n' >broker.ext
openssl x509 -req -in broker.csr -CA authority.pem -CAkey authority.key -CAcreateserial -days 36500 -extfile broker.ext -out broker.pem
mosquitto_passwd -c -b passwords tester correct
rm -f ./*.srl ./*.csr ./*.ext authority.key another-authority.key
chmod 644 broker.key passwords
