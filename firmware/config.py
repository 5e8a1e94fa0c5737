"""What this board is: its pins, its chips and how it starts. Change this file and no other."""

BUS = 0  # number of the I2C peripheral
SCL = 5  # GP5 and GP4 on a Raspberry Pi Pico; 9 and 8 are usual on ESP32-S3 boards
SDA = 4
ADDRESSES = (0x0C, 0x0D, 0x0E)  # chips in the order of the design
REGISTERS = (0x003C, 0x0000, 0x054D)  # 2.5x, RES 2, OSR 1, filter 3: the planar design
RATE = 100  # readings a second, until the host asks for another rate
SERIAL = ""  # "": the microcontroller's own number
