// A drive of ordinary registers behind npm's modbus-serial: TCP (`tcp`) or RTU on a serial device (its path).
//
//   node drive.js tcp|PATH '{"50199": 514, "1299": 0}' [delay_ms]
//
// Prints "listening tcp 127.0.0.1:PORT" or "listening rtu PATH"; on SIGTERM one JSON line of its registers.
"use strict";
const { ServerTCP, ServerSerial } = require("modbus-serial");
const net = require("net");

const registers = new Map(Object.entries(JSON.parse(process.argv[3])).map(([k, v]) => [Number(k), v]));
const delay = Number(process.argv[4] || 0);
const coils = new Map([[64, false]]);

function later(value) {
    return new Promise((done, refuse) => setTimeout(() => (value instanceof Error ? refuse(value) : done(value)), delay));
}

function refused() {
    return Object.assign(new Error("no such register"), { modbusErrorCode: 2 });
}

const vector = {
    getHoldingRegister: (address) => later(registers.has(address) ? registers.get(address) : refused()),
    setRegister: (address, value) => {
        if (!registers.has(address)) return later(refused());
        registers.set(address, value);
        return later(undefined);
    },
    getCoil: (address) => later(coils.get(address) || false),
    setCoil: (address, value) => {
        coils.set(address, value);
        return later(undefined);
    },
};

function tell() {
    process.stdout.write(JSON.stringify({ registers: Object.fromEntries(registers), coils: Object.fromEntries(coils) }) + "\n", () =>
        process.exit(0));
}

process.on("SIGTERM", tell);
if (process.argv[2] === "tcp") {
    const probe = net.createServer();
    probe.listen(0, "127.0.0.1", () => {
        const port = probe.address().port;
        probe.close(() => {
            const server = new ServerTCP(vector, { host: "127.0.0.1", port, debug: false, unitID: 255 });
            server.on("initialized", () => process.stdout.write(`listening tcp 127.0.0.1:${port}\n`));
            server.on("socketError", () => undefined);
        });
    });
} else {
    const server = new ServerSerial(
        vector,
        { port: process.argv[2], debug: false, unitID: 1 },
        { path: process.argv[2], baudRate: 115200, parity: "none", stopBits: 1, dataBits: 8 });
    server.on("initialized", () => process.stdout.write(`listening rtu ${process.argv[2]}\n`));
    server.on("error", () => undefined);
}
