// npm's modbus-serial as a master of our simulator: reads, writes and is refused. Prints one JSON line.
// node master.js PORT | node master.js DEVICE BAUD
"use strict";
const ModbusRTU = require("modbus-serial");

async function main(where, baud) {
    const line = new ModbusRTU();
    if (baud) {
        await line.connectRTUBuffered(where, { baudRate: Number(baud), parity: "even" });
    } else {
        await line.connectTCP("127.0.0.1", { port: Number(where) });
    }
    line.setID(1);
    line.setTimeout(3000);
    const magic = (await line.readHoldingRegisters(0, 2)).data;
    await line.writeRegister(21, 4711);
    const one = (await line.readHoldingRegisters(21, 1)).data;
    await line.writeRegisters(21, [815]);
    const several = (await line.readHoldingRegisters(21, 1)).data;
    let refusal = null;
    try {
        await line.readHoldingRegisters(5000, 1);
    } catch (error) {
        refusal = error.modbusCode || error.message;
    }
    line.close(() => process.stdout.write(JSON.stringify({ magic, one, several, refusal }) + "\n", () => process.exit(0)));
}

main(process.argv[2], process.argv[3]).catch((error) => {
    process.stderr.write(`${error.stack}\n`);
    process.exit(1);
});
